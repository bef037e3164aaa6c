#pragma once
#include <string>

#include "analysis/noise/likelihood.hpp"

namespace ringlock::noise {

/// Does the five-term noise model describe the spectrum? Each p is the chance of a misfit as large if it does.
struct Goodness {
    double p_cumulative = 1.0;  ///< cumulative periodogram (Bartlett; Kolmogorov): power at the wrong frequencies
    double p_bands = 1.0;       ///< chi-squared over bands of frequency: bumps and holes
    double p_line = 1.0;        ///< largest coefficient (Fisher): a spectral line
    bool accepted = true;       ///< none of the three below the threshold
    std::string reason;         ///< where not accepted: which test, where in frequency
};

/// \param spectrum   the record
/// \param best       the fitted model
/// \param tau0_s     sampling interval [s]
/// \param threshold  p below which a test rejects; three tests are made
Goodness goodness_of_fit(const Spectrum& spectrum, const Maximum& best, double tau0_s, double threshold);

}  // namespace ringlock::noise
