#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array resampling_parameters = {
    Parameter{"from_hz", 0.0, 0.0, 1e5, Role::sampled, "rate at which the samples were taken"},
};

class ResamplingStage final : public SampleStage {
   public:
    explicit ResamplingStage(double from_hz) : from_hz_(from_hz) {}
    Place place() const override { return Place::transport; }
    double source_hz(double /*record_hz*/) const override { return from_hz_; }
    void apply(Sampled& samples) const override {
        const std::size_t intervals = samples.increment_arcsec.size();
        std::vector<double> angle(intervals + 1, 0.0);
        for (std::size_t i = 0; i < intervals; ++i) angle[i + 1] = angle[i] + samples.increment_arcsec[i];
        const double ratio = samples.rate_hz / samples.record_hz;
        const auto rows = static_cast<std::size_t>(std::floor(static_cast<double>(intervals) / ratio + 1e-9));
        const auto at = [&](const std::vector<double>& values, double place) {
            const auto i = std::min(static_cast<std::size_t>(place), values.size() - 1);
            const double share = place - static_cast<double>(i);
            return i + 1 < values.size() ? values[i] + share * (values[i + 1] - values[i]) : values.back();
        };
        std::vector<double> increments(rows);
        for (std::size_t k = 0; k < rows; ++k) {
            increments[k] = at(angle, static_cast<double>(k + 1) * ratio) - at(angle, static_cast<double>(k) * ratio);
        }
        samples.increment_arcsec = std::move(increments);
        for (auto& [name, values] : samples.witnesses) {
            std::vector<double> taken(rows);
            // A witness belongs to the middle of its interval.
            for (std::size_t k = 0; k < rows; ++k) {
                taken[k] = at(values, std::max(0.0, (static_cast<double>(k) + 0.5) * ratio - 0.5));
            }
            values = std::move(taken);
        }
        samples.rate_hz = samples.record_hz;
    }

   private:
    double from_hz_;
};

class Resampling final : public Effect {
   public:
    std::string_view name() const override { return "resampling"; }
    std::string_view summary() const override {
        return "Samples taken at another rate than the record's; in records of samples only.";
    }
    std::string_view advice() const override {
        return "Record at the rate of the source, without interpolation between its samples and the record.";
    }
    std::string_view equation() const override {
        return "The angle at the ends of the record's samples is linear between those of samples taken at from_hz: "
               "white rate noise N^2 has over a record interval the variance (N^2/from) "
               "sum of (shares of source intervals)^2, which beats with the distance of the rates (docs/effects.md).";
    }
    std::span<const Parameter> parameters() const override { return resampling_parameters; }
    bool active(const Values& values) const override { return values.at("from_hz") != 0.0; }
    std::optional<SampleStage::Place> sample_place() const override { return SampleStage::Place::transport; }
    std::unique_ptr<SampleStage> sample_stage(const Values& values, const random::Identity& /*who*/) const override {
        return std::make_unique<ResamplingStage>(values.at("from_hz"));
    }
};

}  // namespace

const Effect& resampling() {
    static const Resampling effect;
    return effect;
}

}  // namespace ringlock::effects
