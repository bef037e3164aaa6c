#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"

namespace ringlock::study {

/// Deviations of the Allan family of every arm, from the angle records of a result: every gyro by itself and then the
/// root of the mean variance. Unlike the summary's Allan deviation, which is made of every cycle of the dither while a
/// study runs, they begin at the sampling interval and overlap fully.
///
/// \param path     result of the study
/// \param study    read_result(path)
/// \param factors  averaging factors [samples], one point each in their order; octaves, up to the largest that an
///                 estimator has, where none is given
/// \return one list an arm, in the order of the study's arms
///
/// Throws InputError where the result was written without angle records, its records are damaged or too short for a
/// factor.
std::vector<std::vector<FamilyDeviation>> family_deviations(const std::filesystem::path& path, const Study& study,
                                                            std::span<const allan::Estimator> estimators,
                                                            std::span<const std::int64_t> factors = {});

}  // namespace ringlock::study
