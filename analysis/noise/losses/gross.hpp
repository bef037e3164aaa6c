#pragma once
#include "analysis/noise/losses/lossy_rates.hpp"

namespace ringlock::noise {

/// The record without rates that no Gaussian noise has: they are made missing.
///
/// A rate that differs from the mean of its neighbours by more than eight times the usual deviation would make the
/// noise that fills the gaps larger than that of the record. Chance makes one in 1e15 so large. \return the same record
/// where there is none
LossyRates without_gross(const LossyRates& rates);

}  // namespace ringlock::noise
