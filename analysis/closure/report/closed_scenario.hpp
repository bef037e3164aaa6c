#pragma once
#include <map>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::closure {

/// The closed model as a scenario for `ringlock run` and `ringlock record`: the device as fitted, with the effects that
/// were added. Times count from the start of the record. The scenario obeys all rules of scenarios.
struct ClosedScenario {
    scenario::Scenario scenario;
    /// Origin of values, by "section.key": fitted, with its standard error; declared by the record; or a placeholder,
    /// which the record neither declares nor determines.
    std::map<std::string, std::string> remarks;
    /// Findings that a scenario cannot contain, each a sentence.
    std::vector<std::string> not_held;

    /// Keys whose values are placeholders.
    std::vector<std::string> placeholders() const;
};

/// Makes the scenario. For a record of samples the lock-in threshold is zero: the fitted white noises contain the
/// random walk that the lock-in makes. The white noise of the angle becomes noise of the reader's reference.
ClosedScenario closed_scenario(const record::Record& record, const Closure& closure);

/// The text of closed.toml.
/// \param source  name of the record
std::string to_toml(const ClosedScenario& closed, const std::string& source, Verdict verdict);

/// Start of the record [s], on its own clock.
double start_of(const record::Record& record);

}  // namespace ringlock::closure
