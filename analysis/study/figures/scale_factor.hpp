#pragma once
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

/// The straight line through a sweep of input rates: the figures of gyros that a rate table measures
/// (docs/scale-factor.md).
namespace ringlock::study {

/// A mean over the gyros with its 95 % interval; no value where the interval holds zero.
struct SignedFigure {
    std::optional<double> mean;
    double lo = 0.0;
    double hi = 0.0;
};

/// A size, which cannot be negative, with its 95 % interval. Where the data do not distinguish it from zero there is no
/// value, and `hi` is the upper limit.
struct SizeFigure {
    std::optional<double> value;
    double lo = 0.0;
    double hi = 0.0;
};

struct ScaleFactor {
    double full_scale_deg_h = 0.0;       ///< largest input rate of the sweep, in size
    SignedFigure scale_factor_ppm;       ///< slope of output over input rate less one, mean over the gyros
    SizeFigure repeatability_ppm;        ///< standard deviation of the gyros' slopes, as measured
    double noise_ppm = 0.0;              ///< contribution of the scatter about the lines to it
    SizeFigure beyond_noise_ppm;         ///< the same without this contribution
    SignedFigure bias_deg_h;             ///< the lines at input rate zero, mean over the gyros
    double bias_spread_deg_h = 0.0;      ///< standard deviation of the same over the gyros
    SizeFigure largest_deviation_deg_h;  ///< from the line, of the mean over the gyros; over all rates together
    double largest_deviation_at_deg_h = 0.0;
    SizeFigure nonlinearity_ppm;           ///< that over full scale
    double gyro_deviation_deg_h = 0.0;     ///< largest deviation of a gyro from its own line: median over the gyros ...
    double gyro_deviation_lo_deg_h = 0.0;  ///< ... and their central 68.27 %
    double gyro_deviation_hi_deg_h = 0.0;
    double scatter_deg_h = 0.0;  ///< rms deviation of a gyro's rates from its line, less the deviation that all gyros
                                 ///< share
};

/// Slopes less one of the gyros' own lines [ppm]: least squares of output over input rate. NaN where a rate of the gyro
/// is NaN.
///
/// \param input_rates_deg_h, errors_deg_h  as below
/// Empty where there are fewer than three rates, or the rates are all the same.
std::vector<double> scale_factor_errors_ppm(std::span<const double> input_rates_deg_h,
                                            std::span<const double> errors_deg_h);

/// Fits each gyro's rate errors by a line, and takes the lines together.
///
/// \param input_rates_deg_h  of the sweep
/// \param errors_deg_h       output rate less input rate, [rate][gyro], the same gyros at each rate
/// Nothing where there are fewer than three rates or two gyros, or the rates are all the same.
std::optional<ScaleFactor> scale_factor(std::span<const double> input_rates_deg_h,
                                        std::span<const double> errors_deg_h);

}  // namespace ringlock::study
