#include "engine/scenario/check.hpp"

#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/scenario/rules/rules.hpp"

namespace ringlock::scenario {
namespace {

/// Complaints, and the rules in docs/scenario.md, come in this order.
constexpr std::array groups_of_rules = {rate_rules,    run_rules,    turn_map_rules, noise_rules, lockin_rules,
                                        readout_rules, output_rules, record_rules,   reader_rules};

}  // namespace

std::vector<Complaint> check(const Scenario& scenario) {
    std::vector<Complaint> complaints;
    for (const auto& group : groups_of_rules) {
        for (const Rule& rule : group()) {
            if (Finding finding = rule.find(scenario)) complaints.push_back(std::move(*finding));
        }
    }
    return complaints;
}

std::vector<std::string_view> rules() {
    std::vector<std::string_view> docs;
    for (const auto& group : groups_of_rules) {
        for (const Rule& rule : group()) docs.push_back(rule.doc);
    }
    return docs;
}

}  // namespace ringlock::scenario
