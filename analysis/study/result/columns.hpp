#pragma once
#include <array>

#include "analysis/study/study.hpp"

/// Figures of a study that have a dataset of their own: name, unit, meaning and member. Writing and reading of result
/// files go through these lists.
namespace ringlock::study {

template <class Owner, class Value = double>
struct Column {
    const char* name;
    const char* unit;
    const char* description;
    Value Owner::*field;
};

/// Drawn parameters of the gyros.
inline constexpr std::array drawn_parameters = {
    Column<gyro::Setup>{"input_rate_deg_h", "deg/h", "input rate", &gyro::Setup::input_rate_deg_h},
    Column<gyro::Setup>{"initial_phase_rad", "rad", "optical phase at the first turn", &gyro::Setup::initial_phase_rad},
    Column<gyro::Setup>{"dither_asymmetry_ratio", "1", "positive half cycles stronger by it, and shorter",
                        &gyro::Setup::dither_asymmetry_ratio},
    Column<gyro::Setup>{"lockin_threshold_deg_h", "deg/h", "lock-in threshold", &gyro::Setup::lockin_threshold_deg_h},
    Column<gyro::Setup>{"dither_peak_rate_deg_s", "deg/s", "mean peak rate of the dither",
                        &gyro::Setup::dither_peak_rate_deg_s},
};

/// Mean rate in closed form, only in arms with a closed form. NaN for a gyro without a closed form.
inline constexpr Column<GyroStatistics, std::optional<double>> closed_form_column{
    "rate_error_closed_form_deg_h", "deg/h",
    "mean output rate over infinite time, computed from one cycle, less the input rate",
    &GyroStatistics::rate_error_closed_form_deg_h};

/// Noise coefficients; each has the datasets NAME, NAME_lo, NAME_hi.
inline constexpr std::array coefficient_columns = {
    Column<noise::NoiseFit, noise::Coefficient>{"quantization_arcsec", "arcsec", "white angle noise Q",
                                                &noise::NoiseFit::quantization_arcsec},
    Column<noise::NoiseFit, noise::Coefficient>{"arw_deg_rt_h", "deg/sqrt(h)", "angle random walk N",
                                                &noise::NoiseFit::arw_deg_rt_h},
    Column<noise::NoiseFit, noise::Coefficient>{"bias_instability_deg_h", "deg/h", "bias instability B",
                                                &noise::NoiseFit::bias_instability_deg_h},
    Column<noise::NoiseFit, noise::Coefficient>{"rrw_deg_h_rt_h", "deg/h/sqrt(h)", "rate random walk K",
                                                &noise::NoiseFit::rrw_deg_h_rt_h},
    Column<noise::NoiseFit, noise::Coefficient>{"rate_ramp_deg_h_h", "deg/h/h", "rate ramp R",
                                                &noise::NoiseFit::rate_ramp_deg_h_h},
};

/// Figures from which the noise model of all gyros together is selected.
inline constexpr std::array pooling_columns = {
    Column<noise::Pooling>{"arw_evidence", "1", "rise of the deviance without N, all other terms free",
                           &noise::Pooling::arw_evidence},
    Column<noise::Pooling>{"angle_noise_evidence", "1", "rise of the deviance without Q in the model of Q and N",
                           &noise::Pooling::angle_noise_evidence},
    Column<noise::Pooling>{"arw_alone_deg_rt_h", "deg/sqrt(h)", "N in the model of N alone",
                           &noise::Pooling::arw_alone_deg_rt_h},
    Column<noise::Pooling>{"arw_beside_angle_noise_deg_rt_h", "deg/sqrt(h)", "N in the model of Q and N",
                           &noise::Pooling::arw_beside_angle_noise_deg_rt_h},
    Column<noise::Pooling>{"arw_best_deg_rt_h", "deg/sqrt(h)", "N in the best model that has it",
                           &noise::Pooling::arw_best_deg_rt_h},
};

/// Allan deviations of the gyros.
inline constexpr std::array allan_columns = {
    Column<allan::Point>{"deviation_deg_h", "deg/h", "overlapping Allan deviation, stride tau/8", &allan::Point::dev},
    Column<allan::Point>{"deviation_lo_deg_h", "deg/h", "lower end of its 68.27 % interval", &allan::Point::lo},
    Column<allan::Point>{"deviation_hi_deg_h", "deg/h", "upper end of its 68.27 % interval", &allan::Point::hi},
    Column<allan::Point>{"edf", "1", "equivalent degrees of freedom", &allan::Point::edf},
};

}  // namespace ringlock::study
