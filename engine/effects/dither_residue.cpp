#include <array>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array dither_residue_parameters = {
    Parameter{"frequency_hz", 50.0, 1e-6, 1e5, Role::frequency, "frequency in the middle of the record"},
    Parameter{"drift_hz_per_s", 0.0, -10.0, 10.0, Role::frequency, "change of the frequency there"},
    Parameter{"drift_2_hz_per_s2", 0.0, -1.0, 1.0, Role::frequency, "second derivative of the frequency there"},
    Parameter{"drift_3_hz_per_s3", 0.0, -1.0, 1.0, Role::frequency, "third derivative of the frequency there"},
    Parameter{"drift_4_hz_per_s4", 0.0, -1.0, 1.0, Role::frequency, "fourth derivative of the frequency there"},
    Parameter{"drift_5_hz_per_s5", 0.0, -1.0, 1.0, Role::frequency, "fifth derivative of the frequency there"},
    Parameter{"amplitude_arcsec", 0.0, 0.0, 1e5, Role::sampled, "amplitude of the angle"},
};

class DitherResidueStage final : public SampleStage {
   public:
    explicit DitherResidueStage(const Values& values)
        : course_{values.at("frequency_hz"),      values.at("drift_hz_per_s"),    values.at("drift_2_hz_per_s2"),
                  values.at("drift_3_hz_per_s3"), values.at("drift_4_hz_per_s4"), values.at("drift_5_hz_per_s5")},
          amplitude_arcsec_(values.at("amplitude_arcsec")) {}
    Place place() const override { return Place::output; }
    void apply(Sampled& samples) const override {
        const double middle_s = 0.5 * static_cast<double>(samples.increment_arcsec.size()) / samples.rate_hz;
        const auto angle = [&](std::size_t boundary) {
            const double t = static_cast<double>(boundary) / samples.rate_hz - middle_s;
            double turns = 0.0;
            double power = 1.0;
            for (std::size_t k = 0; k < course_.size(); ++k) {
                power *= t / static_cast<double>(k + 1);
                turns += course_[k] * power;
            }
            return amplitude_arcsec_ * std::sin(units::two_pi * (turns - std::floor(turns)));
        };
        double before = angle(0);
        for (std::size_t i = 0; i < samples.increment_arcsec.size(); ++i) {
            const double now = angle(i + 1);
            samples.increment_arcsec[i] += now - before;
            before = now;
        }
    }

   private:
    std::array<double, 6> course_;  ///< the frequency and its derivatives in the middle
    double amplitude_arcsec_;
};

class DitherResidue final : public Effect {
   public:
    std::string_view name() const override { return "dither_residue"; }
    std::string_view summary() const override {
        return "Dither that was not stripped completely, at its frequency or its alias; in records of samples only.";
    }
    std::string_view advice() const override {
        return "Estimate gain and delay of the dither reference again, or lengthen the filter that strips the dither; "
               "the line is not a rotation of the base.";
    }
    std::string_view equation() const override {
        return "angle = A sin(2 pi (f t + d t^2/2 + d_2 t^3/6 + ...)), t from the middle of the record: "
               "the residue of an error of gain or delay of the dither's pick-off (Killpatrick, "
               "IEEE Spectrum 4(10), 44, 1967), as the frequency follows the temperature of the springs. "
               "In increments A becomes 2 A |sin(pi f/rate)|; above half the rate it shows at its alias.";
    }
    std::span<const Parameter> parameters() const override { return dither_residue_parameters; }
    bool active(const Values& values) const override { return values.at("amplitude_arcsec") != 0.0; }
    std::optional<SampleStage::Place> sample_place() const override { return SampleStage::Place::output; }
    std::unique_ptr<SampleStage> sample_stage(const Values& values, const random::Identity& /*who*/) const override {
        return std::make_unique<DitherResidueStage>(values);
    }
};

}  // namespace

const Effect& dither_residue() {
    static const DitherResidue effect;
    return effect;
}

}  // namespace ringlock::effects
