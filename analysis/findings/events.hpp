#pragma once
#include <cstddef>
#include <vector>

namespace ringlock::findings {

/// What may happen to a series of rates at one time.
enum class Event {
    pulse,    ///< one rate is off
    doublet,  ///< one angle is off: the rate before it and the rate behind it are off by the opposite amount
    step,     ///< all rates from there on are off
};

/// The size that each rate would have as the place of an event, by generalised least squares in the noise of a model.
struct Scan {
    std::vector<double> size;   ///< [unit of the rate]; of a doublet, of the first rate
    std::vector<double> sigma;  ///< size over its standard error
};

/// Sizes of events at all places of a record.
///
/// In the cosine basis of the spectrum the noise of the model is diagonal with variances v_j, so that an event with the
/// coefficients c_j(t) has the size sum c_j r_j/v_j over sum c_j^2/v_j, of variance 1 over sum c_j^2/v_j. With the
/// orthonormal cosines (2/n)^(1/2) cos(pi j (t + 1/2)/n) a pulse at t has just these; a step from t on has
/// -(2/n)^(1/2) sin(pi j t/n)/(2 sin(pi j/(2 n))). Sums over j for all t are Fourier transforms.
/// \param residual  coefficients less the means of the model
/// \param variance  of the coefficients
Scan scan(Event event, const std::vector<double>& residual, const std::vector<double>& variance);

/// Takes an event of that size from the rates.
void take_off(Event event, std::size_t at, double size, std::vector<double>& rate);

/// The residual in time, as white noise of variance one if the model is right: each coefficient over its standard
/// deviation, transformed back.
std::vector<double> whitened(const std::vector<double>& residual, const std::vector<double>& variance);

}  // namespace ringlock::findings
