#include "analysis/study/reader_facts.hpp"

#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::study {

std::vector<ReaderFact> reader_facts(const scenario::Scenario& scenario) {
    const scenario::StudyReader reader = scenario::study_reader(scenario);
    scenario::Scenario resolved = scenario;
    if (scenario::reads_arms(scenario)) resolved.reader.latch_hz = reader.latch_hz;
    std::vector<ReaderFact> facts;
    for (const scenario::Section& section : scenario::schema()) {
        if (section.name != "reader") continue;
        for (const scenario::Key& key : section.keys) {
            const scenario::Value value = key.get(resolved);
            if (const auto* number = std::get_if<double>(&value)) facts.push_back({key.name, *number});
            if (const auto* whole = std::get_if<std::int64_t>(&value)) facts.push_back({key.name, *whole});
            if (const auto* word = std::get_if<std::string>(&value)) facts.push_back({key.name, *word});
        }
    }
    facts.push_back({"delay_s", reader.delay_s});
    facts.push_back({"residue_relative", scenario::reader_residue_relative(scenario)});
    facts.push_back({"warm_up_s", static_cast<double>(reader.warm_up_outputs) / scenario::outputs_hz(scenario)});
    return facts;
}

}  // namespace ringlock::study
