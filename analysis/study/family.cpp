#include "analysis/study/family.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/sums/phase.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/hdf5.hpp"

namespace ringlock::study {
namespace {

/// The record of one gyro. Simulated records have no gaps, and the mean over the gyros needs the same points for all.
allan::Phase phase_of_row(const store::Dataset& angles, std::size_t gyro, double interval_s) {
    const std::vector<double> record = angles.read_rows<double>(gyro, 1);
    // Beyond that, squares overflow.
    constexpr double largest_arcsec = 1e100;
    if (!std::all_of(record.begin(), record.end(), [](double angle) { return std::abs(angle) <= largest_arcsec; })) {
        throw InputError(
            fmt::format("{}: dataset {}, row {}: holds values that are not finite or beyond {:g} arcsec: "
                        "the result is damaged",
                        printable(angles.file()), printable(angles.path()), gyro, largest_arcsec));
    }
    return allan::phase_of(record, allan::Kind::phase, interval_s);
}

/// Rows of the gyros of one point.
struct Rows {
    std::size_t first;
    std::size_t gyros;
};

std::vector<FamilyDeviation> of_arm(const store::Dataset& angles, const Rows& rows, double interval_s,
                                    std::span<const allan::Estimator> estimators, std::span<const std::int64_t> asked) {
    std::vector<std::vector<std::vector<allan::Point>>> curves(estimators.size());
    for (std::size_t row = rows.first; row < rows.first + rows.gyros; ++row) {
        const allan::Phase phase = phase_of_row(angles, row, interval_s);
        const auto points = static_cast<std::int64_t>(phase.x.size());
        for (std::size_t k = 0; k < estimators.size(); ++k) {
            std::vector<std::int64_t> factors(asked.begin(), asked.end());
            if (factors.empty()) factors = allan::octave_factors(allan::largest_factor(estimators[k], points));
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

namespace {

store::Dataset records_of(const store::File& file, const Study& study, std::size_t points, std::size_t arm) {
    store::Dataset angles = file.group("arms").group(study.arms[arm].arm.name).dataset("angle_arcsec");
    if (angles.shape() !=
        store::Shape{study.gyros.size() * points, static_cast<std::uint64_t>(study.schedule.samples)}) {
        throw InputError(
            fmt::format("{}: dataset {} has not one row a gyro and one column a sample: the result is damaged",
                        printable(file.file()), printable(angles.path())));
    }
    return angles;
}

/// \param purpose  ends the sentence "no angle records, from which ..."
void need_angle_records(const std::filesystem::path& path, const Study& study, std::string_view purpose) {
    if (study.scenario.output.angle_record) return;
    throw InputError(
        fmt::format("{}: holds no angle records, from which {}; run the scenario with output.angle_record = true",
                    printable(path), purpose));
}

}  // namespace

std::vector<std::vector<FamilyDeviation>> family_deviations(const std::filesystem::path& path,
                                                            const Experiment& experiment, std::size_t point,
                                                            std::span<const allan::Estimator> estimators,
                                                            std::span<const std::int64_t> factors) {
    const Study& study = experiment.points[point];
    const std::size_t gyros = study.gyros.size();  // of every point as many
    need_angle_records(path, study, "deviations other than its own are computed");
    return store::guarded(path, [&](const store::GuardedPath& guarded) {
        const store::File file = store::File::open(guarded);
        std::vector<std::vector<FamilyDeviation>> out;
        for (std::size_t arm = 0; arm < study.arms.size(); ++arm) {
            const store::Dataset angles = records_of(file, study, experiment.points.size(), arm);
            const Rows rows{point * gyros, gyros};
            if (store::is_trial()) {  // a trial checks only that the data can be read; the deviations take longer than
                                      // any trial may
                for (std::size_t row = 0; row < gyros; ++row) {
                    static_cast<void>(angles.read_rows<double>(rows.first + row, 1));
                }
                continue;
            }
            out.push_back(of_arm(angles, rows, study.schedule.sample_interval_s, estimators, factors));
        }
        return out;
    });
}

std::vector<double> angle_samples(const std::filesystem::path& path, const Experiment& experiment, std::size_t point,
                                  std::size_t arm) {
    const Study& study = experiment.points[point];
    need_angle_records(path, study, "samples are taken");
    return store::guarded(path, [&](const store::GuardedPath& guarded) {
        const store::File file = store::File::open(guarded);
        const store::Dataset angles = records_of(file, study, experiment.points.size(), arm);
        const std::size_t gyros = study.gyros.size();
        if (!store::is_trial()) return angles.read_rows<double>(point * gyros, gyros);
        for (std::size_t row = 0; row < gyros; ++row) {
            static_cast<void>(angles.read_rows<double>(point * gyros + row, 1));
        }
        return std::vector<double>();
    });
}

}  // namespace ringlock::study
