#pragma once
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "engine/scenario/scenario.hpp"

/// The readers of a study, as its result records them.
namespace ringlock::study {

/// A setting of the section [reader] of a scenario, or a figure that follows from the settings.
struct ReaderFact {
    std::string name;  ///< with its unit
    std::variant<std::int64_t, double, std::string> value;
    bool operator==(const ReaderFact&) const = default;
};

/// The settings in the order of the section, with the latching rate as it is, then `delay_s`, by which outputs lag
/// behind a steady rotation, `residue_relative`, the amplitude of a steady dither that is left over that of the dither,
/// and `warm_up_s`, simulated between settling and record. Of a study whose arms are not read the last ones are 0.
std::vector<ReaderFact> reader_facts(const scenario::Scenario& scenario);

}  // namespace ringlock::study
