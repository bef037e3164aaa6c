#pragma once
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "engine/random/stream.hpp"

/// Effects beyond the base equation. One file each, one line in registry.cpp.
namespace ringlock::effects {

/// One parameter of an effect: its name carries the unit, as in a scenario's [effects.NAME] table.
struct Parameter {
    std::string_view name;
    double default_value;  ///< the value at which an effect that is not asked for stands
    double min;
    double max;
    std::string_view doc;  ///< one line
};

/// The value of every parameter of one effect.
using Values = std::map<std::string, double>;

/// A rate that varies in time, given as the angle it adds.
class RateProcess {
   public:
    virtual ~RateProcess() = default;
    /// Rotation [arcsec] added between `start_s` and `start_s + duration_s`. Called with consecutive intervals, once
    /// each.
    virtual double angle_arcsec(double start_s, double duration_s) = 0;
};

/// An effect: what it is called, what it needs, what it does to a gyro.
class Effect {
   public:
    virtual ~Effect() = default;
    virtual std::string_view name() const = 0;
    virtual std::string_view summary() const = 0;   ///< one line
    virtual std::string_view equation() const = 0;  ///< plain text, with its source
    virtual std::span<const Parameter> parameters() const = 0;
    /// True where these values do something.
    virtual bool active(const Values& values) const = 0;
    /// Changes constants of the gyro. The default does nothing.
    virtual void configure(const Values& /*values*/, gyro::Setup& /*setup*/) const {}
    /// A rate process for one gyro, or null where the effect has none.
    virtual std::unique_ptr<RateProcess> rate_process(const Values& /*values*/, const random::Identity& /*who*/) const {
        return nullptr;
    }
};

/// All effects this program can simulate, in the order of their names.
std::span<const Effect* const> registry();

/// The effect of that name or null.
const Effect* find(std::string_view name);

/// Names of effects that are planned but cannot be simulated yet, in order.
std::span<const std::string_view> planned();

}  // namespace ringlock::effects
