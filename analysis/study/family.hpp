#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/summary.hpp"

namespace ringlock::study {

/// Deviations of the Allan family of every arm, from the angle records of a result: every gyro by itself and then the
/// root of the mean variance. Unlike the summary's Allan deviation, which is made of every output while a study runs,
/// they begin at the sampling interval and overlap fully.
///
/// \param path     result of the study
/// \param experiment  read_result(path)
/// \param point    of its points
/// \param factors  averaging factors [samples], one point each in their order; octaves, up to the largest that an
///                 estimator has, where none is given
/// \return one list an arm, in the order of the scenario's arms
///
/// Throws InputError where the result was written without angle records, its records are damaged or too short for a
/// factor.
std::vector<std::vector<FamilyDeviation>> family_deviations(const std::filesystem::path& path,
                                                            const Experiment& experiment, std::size_t point,
                                                            std::span<const allan::Estimator> estimators,
                                                            std::span<const std::int64_t> factors = {});

/// Angle samples of all gyros of an arm at a point of a result, [gyro][sample] in arcsec. Throws InputError where the
/// file has none or is damaged.
std::vector<double> angle_samples(const std::filesystem::path& path, const Experiment& experiment, std::size_t point,
                                  std::size_t arm);

}  // namespace ringlock::study
