// What noise on the drive of a dither does to the output: angle random walk over the theory of full randomisation, and
// bias, by the exact turn map with an ideal readout.
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <cstdio>
#include <numeric>
#include <string>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "engine/gyro/resonator.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/parse.hpp"

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
    const double theory_arcsec_rt_s = 60.0 * gyro::angle_random_walk_deg_rt_h(setup);
    const double arw = std::sqrt(variance);
    return {arw / theory_arcsec_rt_s, 0.5 * variance_error / arw / theory_arcsec_rt_s, bias, bias_error};
}

void row(const std::string& device, double rate_deg_h, const std::string& noise) {
    const scenario::Scenario s = scenario::parse_string(
        fmt::format("device = \"{}\"\n[input]\nrate_deg_h = {}\n[readout]\nmodel = \"ideal\"\n[ensemble]\ngyros = 96\n"
                    "dither_amplitude_sd_relative = 0.0\ndither_asymmetry_sd_ratio = 0.0\n[arms]\n"
                    "names = [\"noise_injected\"]\n[noise_injection]\n{}",
                    device, rate_deg_h, noise),
        "case");
    const scenario::NoiseInjection& n = s.noise_injection;
    const Seen seen = simulate(s);
    std::string what = "turns";
    double change_rad = std::sqrt(2.0) * n.turn_phase_rms_rad;
    if (n.model == scenario::NoiseModel::drive) {
        static constexpr const char* forms[] = {"held", "white", "sinusoidal"};
        what = fmt::format("{}, Q {:g}, hold {}", forms[static_cast<int>(n.form)], n.resonator_q, n.hold_half_cycles);
        change_rad = n.turn_phase_rms_rad * gyro::Resonator(scenario::drive_noise(s)).change_per_cycle();
    }
    fmt::print("| {} | {} | {:g} | {:g} | {:.2f} | {:.3f} +- {:.3f} | {:.4f} +- {:.4f} |\n", device, what,
               n.turn_phase_rms_rad, rate_deg_h, change_rad, seen.arw_over_theory, seen.arw_error, seen.bias_deg_h,
               seen.bias_error_deg_h);
    std::fflush(stdout);
}

std::string drive(double q, double rms_rad, int hold, const char* form = "held") {
    return fmt::format(
        "model = \"drive\"\nresonator_q = {}\nturn_phase_rms_rad = {}\nhold_half_cycles = {}\nform = \"{}\"\n", q,
        rms_rad, hold, form);
}

}  // namespace
}  // namespace ringlock

int main() {
    using namespace ringlock;
    std::setvbuf(stdout, nullptr, _IOLBF, 0);
    fmt::print(
        "| device | noise | rms at the turns [rad] | input [deg/h] | change per cycle [rad] | ARW over theory | bias "
        "[deg/h] |\n|---|---|---|---|---|---|---|\n");
    const std::string paper = "gao-deng-2007";
    row(paper, 1.0, "turn_phase_rms_rad = 3.0\n");
    row(paper, 1.0, drive(50, 3, 1));
    row(paper, 1.0, drive(100, 3, 1));
    row(paper, 1.0, drive(100, 3, 1, "white"));
    row(paper, 1.0, drive(100, 10, 1));
    row(paper, 1.0, drive(100, 10, 4));
    row(paper, 1.0, drive(100, 10, 10));
    for (const double rate : {0.0, 1.0, 15.0}) row(paper, rate, drive(300, 3, 1));
    row("triangle-51mm", 1.0, drive(100, 3, 1));
    row("triangle-51mm", 1.0, drive(100, 10, 1));
    row("triangle-20mm", 1.0, drive(100, 5, 1));
}
