#pragma once
#include <span>
#include <string>

#include "analysis/noise/model/line.hpp"

namespace ringlock::noise {

/// Does the model describe the spectrum? Each p is the chance of a misfit as large if it does.
struct Goodness {
    double p_cumulative = 1.0;    ///< cumulative periodogram (Bartlett; Kolmogorov): power at the wrong frequencies
    double p_bands = 1.0;         ///< chi-squared over bands of frequency: bumps and holes
    double p_line = 1.0;          ///< largest coefficient (Fisher): one more spectral line
    double p_around_lines = 1.0;  ///< chi-squared next to each line that was found: a narrow resonance is no line
    bool accepted = true;         ///< none of them below the threshold
    std::string reason;           ///< where not accepted: which test, where in frequency
};

/// \param spectrum   the record without its lines
/// \param best       the fitted model
/// \param lines      what was taken off
/// \param tau0_s     sampling interval [s]
/// \param threshold  p below which a test rejects; three tests are made, with lines four
Goodness goodness_of_fit(const Spectrum& spectrum, const Maximum& best, std::span<const Line> lines, double tau0_s,
                         double threshold);

}  // namespace ringlock::noise
