#pragma once
#include <memory>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The same model with the error of the declared reader's counts as narrow noise; null where the reader counts with a
/// fraction or elsewhere than at the zero crossings of the dither, where no dither or scale factor is declared, or
/// where the record does not show it.
///
/// At a zero crossing the dither adds nothing to the angle theta, and a count of whole quarter fringes q = K/4 is off
/// by a sawtooth, q/pi sum sin(2 pi m theta/q)/m. Where theta advances at a rate Omega and diffuses by D a second,
/// harmonic m has the autocovariance q^2/(2 pi^2 m^2) cos(2 pi m Omega t/q) exp(-2 pi^2 m^2 D t/q^2): a line of full
/// width 2 pi m^2 D/q^2 at half maximum. Elsewhere in the half cycle the dither passes hundreds of steps, and the error
/// is white.
std::shared_ptr<SampleFit> with_count_error(const SampleFit& fit, const record::Record& record);

/// The same model with the noise of the dither's amplitude that zero crossings have which the measured dither shows
/// late by the declared delay: delay times peak rate times the relative amplitude, which a resonator remembers. Null
/// where no such reader is declared, or where the record speaks against it.
std::shared_ptr<SampleFit> with_late_crossings(const SampleFit& fit, const record::Record& record);

/// The same model with errors of readings whose variance goes up and down, as they do that are interpolated between
/// errors at the zero crossings of the dither: at the alias of its frequency. Null where another reader is declared,
/// where the record does not show it, and where the model has a source whose readings are interpolated.
std::shared_ptr<SampleFit> with_interpolated_errors(const SampleFit& fit, const record::Record& record);

}  // namespace ringlock::closure
