#include <array>
#include <span>

#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

Finding turns_are_not_compensated(const Scenario& s) {
    if (s.record.kind == RecordKind::samples || s.record.trajectory.compensator == Compensator::none) return {};
    return Complaint{{"record.trajectory", "record.kind"},
                     "a record of turns holds the readings of the electronics before any compensation; "
                     "record an arm without compensator, or samples"};
}

constexpr std::array all_record_rules = {
    Rule{"A record of turns is that of an arm without compensator.", turns_are_not_compensated},
};

}  // namespace

std::span<const Rule> record_rules() { return all_record_rules; }

}  // namespace ringlock::scenario
