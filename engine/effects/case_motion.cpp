#include <array>
#include <cmath>
#include <string>

#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array case_motion_parameters = {
    Parameter{"witness", 0.0, 0.0, 2.0, Role::setting, "accelerometer that sees it: 0 accel_x, 1 accel_y, 2 accel_z"},
    Parameter{"coherence", 1.0, 0.0, 1.0, Role::setting, "magnitude-squared coherence of witness and rotation"},
    Parameter{"rms_arcsec", 0.0, 0.0, 1e5, Role::sampled, "rms of the angle"},
    Parameter{"centre_hz", 5.0, 1e-3, 1e5, Role::setting, "frequency of the resonance"},
    Parameter{"width_hz", 4.0, 1e-3, 1e5, Role::setting, "width of the resonance at half its power"},
};

constexpr double gravity_m_s2 = 9.80665;
constexpr const char* witness_names[] = {"accel_x", "accel_y", "accel_z"};

/// x_k = 2 r cos(w) x_{k-1} - r^2 x_{k-2} + e_k, of that rms.
std::vector<double> resonance(std::size_t size, double rate_hz, const Values& values, const random::Identity& who,
                              random::Purpose purpose) {
    const double r = std::exp(-units::pi * values.at("width_hz") / rate_hz);
    const double a = 2.0 * r * std::cos(units::two_pi * values.at("centre_hz") / rate_hz);
    const double b = r * r;
    const double rms = values.at("rms_arcsec");
    // Variance over that of e (Box and Jenkins, "Time Series Analysis", 1976, section 3.2.4)
    const double gain = std::sqrt((1.0 - b) * ((1.0 + b) * (1.0 + b) - a * a) / (1.0 + b));
    const double first = a / (1.0 + b);
    random::NormalStream normal(who, purpose);
    std::vector<double> x(size);
    for (std::size_t k = 0; k < size; ++k) {
        const double e = rms * normal();
        x[k] = k == 0   ? e
               : k == 1 ? first * x[0] + std::sqrt(1.0 - first * first) * e
                        : a * x[k - 1] - b * x[k - 2] + gain * e;
    }
    return x;
}

class CaseMotionStage final : public SampleStage {
   public:
    CaseMotionStage(const Values& values, const random::Identity& who) : values_(values), who_(who) {}
    Place place() const override { return Place::motion; }
    void apply(Sampled& samples) const override {
        const std::size_t rows = samples.increment_arcsec.size();
        const auto angle = resonance(rows + 1, samples.rate_hz, values_, who_, random::Purpose::case_motion);
        const auto other = resonance(rows + 1, samples.rate_hz, values_, who_, random::Purpose::witness_motion);
        const double seen = std::sqrt(values_.at("coherence"));
        const double unseen = std::sqrt(1.0 - values_.at("coherence"));
        std::vector<double> witness(rows);
        for (std::size_t k = 0; k < rows; ++k) {
            samples.increment_arcsec[k] += angle[k + 1] - angle[k];
            const double tilt = 0.5 * (seen * (angle[k] + angle[k + 1]) + unseen * (other[k] + other[k + 1]));
            witness[k] = gravity_m_s2 * tilt * units::pi / (180.0 * units::arcsec_per_deg);
        }
        samples.witnesses[witness_names[std::lround(values_.at("witness"))]] = std::move(witness);
    }

   private:
    Values values_;
    random::Identity who_;
};

class CaseMotion final : public Effect {
   public:
    std::string_view name() const override { return "case_motion"; }
    std::string_view summary() const override {
        return "Rotation of the case that an accelerometer sees as well; in records of samples only.";
    }
    std::string_view advice() const override {
        return "Mount the gyro on a quieter pier, or subtract the motion that the accelerometers see; "
               "record the witnesses at the rate of the gyro.";
    }
    std::string_view equation() const override {
        return "angle = a resonance driven by white noise, a second-order autoregression of that centre, "
               "width and rms; the accelerometer, tilted, reads g (sqrt(C) angle + sqrt(1 - C) other), "
               "the other independent of the angle and like it: C is their coherence (Bendat and Piersol, "
               "\"Random Data\", 2010, section 6.1).";
    }
    std::span<const Parameter> parameters() const override { return case_motion_parameters; }
    bool active(const Values& values) const override { return values.at("rms_arcsec") != 0.0; }
    std::optional<SampleStage::Place> sample_place() const override { return SampleStage::Place::motion; }
    std::unique_ptr<SampleStage> sample_stage(const Values& values, const random::Identity& who) const override {
        return std::make_unique<CaseMotionStage>(values, who);
    }
};

}  // namespace

const Effect& case_motion() {
    static const CaseMotion effect;
    return effect;
}

}  // namespace ringlock::effects
