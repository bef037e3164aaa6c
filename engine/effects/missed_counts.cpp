#include <array>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array missed_counts_parameters = {
    Parameter{"probability_per_turn", 0.0, 0.0, 1.0, Role::probability,
              "probability that a quarter fringe was missed in the half cycle before a turn"},
};

class MissedCounts final : public Effect {
   public:
    std::string_view name() const override { return "missed_counts"; }
    std::string_view summary() const override { return "The up/down counter misses pulses of the quarter fringes."; }
    std::string_view advice() const override {
        return "Compare the count with the phase of the detectors at each turn: "
               "a repair by the quadrature takes whole quarter fringes off; "
               "check the bandwidth of the counter at the peak rate.";
    }
    std::string_view equation() const override {
        return "At each turn, with that probability, the count has fallen behind by one quarter fringe "
               "in the direction of motion of the half cycle before, for good. An angle interpolated "
               "from the quadrature stays on the branch nearest to the quarter that the counter names: "
               "it is wrong by whole fringes, and only once two counts or more are missing (docs/dev/readout.md).";
    }
    std::span<const Parameter> parameters() const override { return missed_counts_parameters; }
    bool active(const Values& values) const override { return values.at("probability_per_turn") != 0.0; }
    void configure(const Values& values, gyro::Setup& setup) const override {
        setup.missed_count_probability = values.at("probability_per_turn");
    }
};

}  // namespace

const Effect& missed_counts() {
    static const MissedCounts effect;
    return effect;
}

}  // namespace ringlock::effects
