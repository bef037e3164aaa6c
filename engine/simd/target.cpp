#include "engine/simd/target.hpp"

#include <fmt/format.h>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/simd/target.cpp"
#include "engine/core/error.hpp"
#include "engine/simd/targets.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::simd::HWY_NAMESPACE {
const char* name() { return hwy::TargetName(HWY_TARGET); }
}  // namespace ringlock::simd::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::simd {

HWY_EXPORT(name);

std::string active_target() { return HWY_DYNAMIC_DISPATCH(name)(); }

std::vector<std::string> available_targets() {
    std::vector<std::string> names;
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) names.emplace_back(hwy::TargetName(target));
    return names;
}

void use_target(const std::string& wanted) {
    hwy::SetSupportedTargetsForTest(0);  // the previous choice hides the other targets
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
        if (wanted != hwy::TargetName(target)) continue;
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        return;
    }
    throw RunError(fmt::format("instruction set {}: this program or this machine does not have it", wanted));
}

void use_best_target() {
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace ringlock::simd
#endif
