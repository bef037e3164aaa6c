#include <array>
#include <cmath>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array count_quantization_parameters = {
    Parameter{"step_arcsec", 0.0, 0.0, 1e4, Role::sampled, "step of the angle that is put out"},
};

/// Whole steps of the angle since the start, as differences.
class CountQuantizationStage final : public SampleStage {
   public:
    explicit CountQuantizationStage(double step_arcsec) : step_(step_arcsec) {}
    Place place() const override { return Place::resolution; }
    void apply(Sampled& samples) const override {
        double angle = 0.0;
        double before = 0.0;
        for (double& increment : samples.increment_arcsec) {
            angle += increment;
            const double steps = std::floor(angle / step_);
            increment = (steps - before) * step_;
            before = steps;
        }
    }

   private:
    double step_;
};

class CountQuantization final : public Effect {
   public:
    std::string_view name() const override { return "count_quantization"; }
    std::string_view summary() const override {
        return "Samples of the angle in whole steps; in records of samples only.";
    }
    std::string_view advice() const override {
        return "Read a finer count, or average over longer samples: the error of a step falls with the averaging time, "
               "the random walk by its root.";
    }
    std::string_view equation() const override {
        return "angle = floor(angle/step) step at the end of each sample. "
               "Where the angle moves by a step or more from sample to sample the error is white and uniform, "
               "of variance step^2/12 (Widrow and Kollar, \"Quantization Noise\", 2008, chapter 4).";
    }
    std::span<const Parameter> parameters() const override { return count_quantization_parameters; }
    bool active(const Values& values) const override { return values.at("step_arcsec") != 0.0; }
    std::optional<SampleStage::Place> sample_place() const override { return SampleStage::Place::resolution; }
    std::unique_ptr<SampleStage> sample_stage(const Values& values, const random::Identity& /*who*/) const override {
        return std::make_unique<CountQuantizationStage>(values.at("step_arcsec"));
    }
};

}  // namespace

const Effect& count_quantization() {
    static const CountQuantization effect;
    return effect;
}

}  // namespace ringlock::effects
