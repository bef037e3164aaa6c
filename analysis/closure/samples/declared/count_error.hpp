#pragma once
#include <memory>

#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/record/record.hpp"

namespace ringlock::closure {

/// The same model with the error of the declared reader's counts as narrow noise; null where the reader counts with a
/// fraction or elsewhere than at the zero crossings of the dither, where no dither or scale factor is declared, or
/// where the record does not show the error.
///
/// At a zero crossing the dither adds nothing to the angle theta, and a count of whole quarter fringes q = K/4 has an
/// error that is a sawtooth, q/pi sum sin(2 pi m theta/q)/m. Where theta advances at a rate Omega and diffuses by D a
/// second, harmonic m has the autocovariance q^2/(2 pi^2 m^2) cos(2 pi m Omega t/q) exp(-2 pi^2 m^2 D t/q^2): a line of
/// full width 2 pi m^2 D/q^2 at half maximum. Elsewhere in the half cycle the dither passes hundreds of steps, and the
/// error is white.
std::shared_ptr<SampleFit> with_count_error(const SampleFit& fit, const record::Record& record);

/// The same model with noise of the dither's amplitude, in a reader whose measured dither, and with it the zero
/// crossings, is late by the declared delay: delay times peak rate times the relative amplitude, which a resonator
/// remembers. Null where no such reader is declared, or where the record does not gain by it.
std::shared_ptr<SampleFit> with_late_crossings(const SampleFit& fit, const record::Record& record);

/// The same model with errors of readings whose variance oscillates at the alias of the dither's frequency, as that of
/// readings interpolated between errors at the dither's zero crossings. Null where another reader is declared, where
/// the record does not show it, and where the model has a source whose readings are interpolated.
std::shared_ptr<SampleFit> with_interpolated_errors(const SampleFit& fit, const record::Record& record);

}  // namespace ringlock::closure
