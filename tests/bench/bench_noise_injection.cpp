// Effect of noise on the drive of a dither: angle random walk over the theory of full randomisation, and bias, both as
// predicted and as simulated by the exact turn map with an ideal readout. --all: 46 cases.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <vector>

#include "engine/dither/noise_effectiveness.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock {
namespace {

constexpr std::size_t blocks = 96 / simd::lanes;
constexpr double duration_s = 640.0;
constexpr double settle_s = 4.0;
constexpr double tau_s = 32.0;

struct Seen {
    double arw_over_theory = 0.0;
    double arw_error = 0.0;
    double bias_deg_h = 0.0;
    double bias_error_deg_h = 0.0;
};

/// Allan deviation at 32 s of all gyros together, as a random walk, and the mean rate beyond the input.
Seen simulate(const scenario::Scenario& s) {
    const gyro::Setup setup = scenario::configured_setup(s);
    const double period_s = 1.0 / s.dither.frequency_hz;
    const auto skipped = static_cast<std::size_t>(settle_s / period_s);
    const auto cycles = static_cast<std::size_t>(duration_s / period_s);
    const auto factor = static_cast<std::size_t>(tau_s / period_s);
    std::vector<double> mean_squares(blocks * simd::lanes);
    std::vector<double> rates(blocks * simd::lanes);
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t number) {
        ensemble::GyroBlock block(s, s.arms, static_cast<std::int64_t>(number * simd::lanes), simd::lanes);
        std::vector<std::vector<double>> angle_arcsec(simd::lanes);
        for (std::size_t done = 0; done < skipped + cycles;) {
            const std::size_t some = std::min<std::size_t>(64, skipped + cycles - done);
            block.advance(2 * some);
            for (std::size_t i = 0; i < some; ++i) {
                if (done + i < skipped) continue;
                for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                    angle_arcsec[lane].push_back(
                        setup.scale_factor_arcsec *
                        (block.angles(0).angle_whole[2 * i][lane] + block.angles(0).angle_fringes[2 * i][lane]));
                }
            }
            done += some;
        }
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const std::vector<double>& x = angle_arcsec[lane];
            double sum = 0.0;
            for (std::size_t i = 0; i + 2 * factor < x.size(); ++i) {
                const double d = x[i + 2 * factor] - 2.0 * x[i + factor] + x[i];
                sum += d * d;
            }
            const std::size_t gyro = number * simd::lanes + lane;
            mean_squares[gyro] = sum / (2.0 * tau_s * static_cast<double>(x.size() - 2 * factor));
            const double input = s.input.rate_deg_h;  // [deg/h] is [arcsec/s]
            rates[gyro] = (x.back() - x.front()) / (period_s * static_cast<double>(x.size() - 1)) - input;
        }
    });
    const auto mean_and_error = [](const std::vector<double>& values) {
        const auto count = static_cast<double>(values.size());
        const double mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
        double squares = 0.0;
        for (const double value : values) squares += (value - mean) * (value - mean);
        return std::pair(mean, std::sqrt(squares / (count - 1.0) / count));
    };
    const auto [variance, variance_error] = mean_and_error(mean_squares);
    const auto [bias, bias_error] = mean_and_error(rates);
    const double theory_arcsec_rt_s = 60.0 * gyro::randomised_arw_deg_rt_h(setup);
    const double arw = std::sqrt(variance);
    return {arw / theory_arcsec_rt_s, 0.5 * variance_error / arw / theory_arcsec_rt_s, bias, bias_error};
}

/// How far the predictions are off over all rows.
struct Worst {
    double arw_relative = 0.0;
    double bias_deg_h = 0.0;
    double bias_errors = 0.0;  ///< in standard errors of the simulation
    int cases = 0;
    int missed = 0;  ///< random walk off by more than 5 %, or bias by more than three errors and 0.01 deg/h
    double slowest_s = 0.0;
};

void row(const std::string& device, double rate_deg_h, const std::string& noise, Worst& worst) {
    const scenario::Scenario s = scenario::parse_string(
        fmt::format("device = \"{}\"\n[input]\nrate_deg_h = {}\n[readout]\nmodel = \"ideal\"\n[ensemble]\ngyros = 96\n"
                    "dither_amplitude_sd_relative = 0.0\ndither_asymmetry_sd_ratio = 0.0\n[arms]\n"
                    "names = [\"noise_injected\"]\n[noise_injection]\n{}",
                    device, rate_deg_h, noise),
        "case");
    const scenario::NoiseInjection& n = s.noise_injection;
    dither::InjectedTurns injected;
    injected.rms_rad = scenario::injected_noise(s).turn_rms_rad;
    std::string what = "turns";
    if (n.model == scenario::NoiseModel::drive) {
        injected.drive = scenario::drive_noise(s);
        static constexpr const char* forms[] = {"held", "white", "sinusoidal"};
        what = fmt::format("{}, Q {:g}, hold {}", forms[static_cast<int>(n.form)], n.resonator_q, n.hold_half_cycles);
    }
    const auto start = std::chrono::steady_clock::now();
    const dither::NoiseEffectiveness predicted =
        dither::predict_noise_effectiveness(ensemble::nominal_setup(s), injected);
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const Seen seen = simulate(s);
    fmt::print("| {} | {} | {:g} | {:g} | {:.2f} | {:.3f} | {:.3f} +- {:.3f} | {:.4f} | {:.4f} +- {:.4f} |\n", device,
               what, n.turn_phase_rms_rad, rate_deg_h, predicted.change_per_cycle_rad,
               predicted.arw_over_theory.value_or(0.0), seen.arw_over_theory, seen.arw_error,
               predicted.bias_deg_h.value_or(0.0), seen.bias_deg_h, seen.bias_error_deg_h);
    std::fflush(stdout);
    const double arw = std::abs(predicted.arw_over_theory.value_or(0.0) / seen.arw_over_theory - 1.0);
    const double bias = std::abs(predicted.bias_deg_h.value_or(0.0) - seen.bias_deg_h);
    worst.arw_relative = std::max(worst.arw_relative, arw);
    worst.bias_deg_h = std::max(worst.bias_deg_h, bias);
    worst.bias_errors = std::max(worst.bias_errors, bias / seen.bias_error_deg_h);
    worst.slowest_s = std::max(worst.slowest_s, seconds);
    ++worst.cases;
    if (arw > 0.05 || bias > std::max(0.01, 3.0 * seen.bias_error_deg_h)) ++worst.missed;
}

std::string drive(double q, double rms_rad, int hold, const char* form = "held") {
    return fmt::format(
        "model = \"drive\"\nresonator_q = {}\nturn_phase_rms_rad = {}\nhold_half_cycles = {}\nform = \"{}\"\n", q,
        rms_rad, hold, form);
}

}  // namespace
}  // namespace ringlock

int main(int argc, char** argv) {
    using namespace ringlock;
    const bool all = argc > 1 && std::string(argv[1]) == "--all";
    if (argc > (all ? 2 : 1)) {
        fmt::print(stderr, "usage: bench_noise_injection [--all]\n");
        return 2;
    }
    std::setvbuf(stdout, nullptr, _IOLBF, 0);
    fmt::print(
        "| device | noise | rms at the turns [rad] | input [deg/h] | change per cycle [rad] | ARW over theory, "
        "predicted | simulated | bias [deg/h], predicted | simulated |\n|---|---|---|---|---|---|---|---|---|\n");
    const std::string paper = "gao-deng-2007";
    Worst worst;
    row(paper, 1.0, "turn_phase_rms_rad = 3.0\n", worst);
    row(paper, 1.0, drive(50, 3, 1), worst);
    row(paper, 1.0, drive(100, 3, 1), worst);
    row(paper, 1.0, drive(100, 3, 1, "white"), worst);
    row(paper, 1.0, drive(100, 10, 1), worst);
    row(paper, 1.0, drive(100, 10, 4), worst);
    row(paper, 1.0, drive(100, 10, 10), worst);
    for (const double rate : {0.0, 1.0, 15.0}) row(paper, rate, drive(300, 3, 1), worst);
    row("triangle-51mm", 1.0, drive(100, 3, 1), worst);
    row("triangle-51mm", 1.0, drive(100, 10, 1), worst);
    row("triangle-20mm", 1.0, drive(100, 5, 1), worst);
    if (all) {
        for (const char* form : {"held", "white"}) {
            for (const double rate : {0.0, 1.0, 5.0}) {
                row(paper, rate, drive(50, 2, 1, form), worst);
                row(paper, rate, drive(200, 6, 1, form), worst);
                row("square-90mm", rate, drive(100, 5, 1, form), worst);
                row("triangle-51mm", rate, drive(200, 8, 1, form), worst);
            }
        }
        for (const int hold : {2, 3, 8}) {
            row(paper, 2.0, drive(50, 4, hold), worst);
            row("square-70mm", 2.0, drive(100, 12, hold), worst);
        }
        row("triangle-20mm", 5.0, drive(50, 4, 2), worst);
        row("triangle-20mm", 0.0, drive(200, 5, 1), worst);
        row("square-50mm", 1.0, drive(300, 10, 4), worst);
    }
    fmt::print(
        "{} cases; predictions off by at most {:.1f} % of the random walk, {:.4f} deg/h or {:.1f} standard errors "
        "of the bias; {} beyond 5 % or both 3 standard errors and 0.01 deg/h; slowest prediction {:.2f} s\n",
        worst.cases, 100.0 * worst.arw_relative, worst.bias_deg_h, worst.bias_errors, worst.missed, worst.slowest_s);
    return 0;
}
