#include "analysis/study/family.hpp"

#include <fmt/format.h>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/sums/phase.hpp"
#include "engine/core/error.hpp"
#include "engine/store/hdf5.hpp"

namespace ringlock::study {
namespace {

std::vector<FamilyDeviation> of_arm(const store::Dataset& angles, std::size_t gyros, double interval_s,
                                    std::span<const allan::Estimator> estimators) {
    std::vector<std::vector<std::vector<allan::Point>>> curves(estimators.size());
    for (std::size_t gyro = 0; gyro < gyros; ++gyro) {
        const allan::Phase phase = allan::phase_of(angles.read_rows<double>(gyro, 1), allan::Kind::phase, interval_s);
        const auto points = static_cast<std::int64_t>(phase.x.size());
        for (std::size_t k = 0; k < estimators.size(); ++k) {
            const auto factors = allan::octave_factors(allan::largest_factor(estimators[k], points));
            curves[k].push_back(allan::deviation(estimators[k], phase, interval_s, factors));
        }
    }
    std::vector<FamilyDeviation> out;
    for (std::size_t k = 0; k < estimators.size(); ++k) {
        out.push_back({estimators[k], ensemble_points(curves[k])});
    }
    return out;
}

}  // namespace

std::vector<std::vector<FamilyDeviation>> family_deviations(const std::filesystem::path& path, const Study& study,
                                                            std::span<const allan::Estimator> estimators) {
    const store::File file = store::File::open(path);
    if (!study.scenario.output.angle_record) {
        throw InputError(fmt::format(
            "{}: holds no angle records, which other deviations than its own are made of; run the scenario with "
            "output.angle_record = true",
            path.string()));
    }
    std::vector<std::vector<FamilyDeviation>> out;
    for (const ArmStatistics& arm : study.arms) {
        const store::Dataset angles = file.group("arms").group(arm.arm.name).dataset("angle_arcsec");
        if (angles.shape().size() != 2 || angles.shape()[0] != study.gyros.size()) {
            throw InputError(fmt::format("{}: dataset {} has not one row a gyro: the result is damaged", path.string(),
                                         angles.path()));
        }
        out.push_back(of_arm(angles, study.gyros.size(), study.schedule.sample_interval_s, estimators));
    }
    return out;
}

}  // namespace ringlock::study
