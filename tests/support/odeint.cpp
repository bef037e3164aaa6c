#include "tests/support/odeint.hpp"

#include <fmt/format.h>

#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>

#include "engine/core/error.hpp"
#include "tests/support/deviation.hpp"

namespace ringlock::test {

namespace odeint = boost::numeric::odeint;

Odeint::Odeint(gyro::Coupling coupling, double tolerance_rad, double longest_step_fringes)
    : coupling_(coupling), tolerance_rad_(tolerance_rad), longest_step_fringes_(longest_step_fringes) {}

double Odeint::lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) {
    using Stepper = odeint::runge_kutta_fehlberg78<double>;
    const Deviation equation(coupling_, half, phase_rad);
    const double longest_s =
        longest_step_fringes_ * units::two_pi / equation.fastest_rad_s();  // 0 means none to odeint as well
    double deviation_rad = 0.0;
    const auto rate = [&](const double& x_rad, double& rate_rad_s, double t_s) {
        ++evaluations_;
        rate_rad_s = equation.rate_rad_s(t_s, x_rad);
    };
    try {
        // The first step: short against the shortest fringe.
        odeint::integrate_adaptive(odeint::make_controlled<Stepper>(tolerance_rad_, tolerance_rad_, longest_s), rate,
                                   deviation_rad, 0.0, half.duration_s, 0.05 / equation.fastest_rad_s());
    } catch (const odeint::odeint_error& error) {
        throw RunError(fmt::format("Boost.odeint: {}", error.what()));
    }
    return deviation_rad;
}

}  // namespace ringlock::test
