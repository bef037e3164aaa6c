#pragma once
#include <memory>
#include <optional>
#include <string>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/samples/model/states.hpp"
#include "analysis/record/record.hpp"

/// Properties of samples that follow from the declared reader and are no effects that the model lacks.
namespace ringlock::closure {

/// The record as the loop reads it. A low-pass filter suppresses signals that are faster than its length: samples are
/// summed until one is as long as the filter, so that only adjacent samples share it. Where the reader leaves the noise
/// of the dither, samples are summed until one lasts for a half cycle, whose readings share that noise. `note` says so
/// if samples were summed.
record::Record summed_for_reader(const record::Record& record, std::string& note);

/// Whether the declared reader leaves the dither in the samples, or removes its line alone.
bool leaves_dither_noise(const record::Record& record);

/// Division of white rate noise between a row and the next by a low-pass filter; null where the reader has none.
std::shared_ptr<const KickRows> filtered_rows(const record::Record& record);

/// Rms of the uniform error that a count of quarter fringes leaves in each reading [arcsec]; 0 where none is declared.
double count_noise_arcsec(const record::Record& record);

/// Whether the step follows from the declared reader: a line within its residue of the dither, or samples interpolated
/// from whole cycles of it. `why` is a sentence on the reason.
bool accounted_by_reader(const Step& step, const record::Record& record, std::string& why);

/// The value that a step found for the first parameter of that role; 0 where it has none.
double value_of(const Step& step, effects::Role role);

/// Amplitude of the line that a step added, as an angle [arcsec]; no value if it added none. Lines in the rate and in
/// the angle are not distinguished.
std::optional<double> line_arcsec(const Step& step);

}  // namespace ringlock::closure
