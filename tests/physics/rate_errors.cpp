// Rate errors that compensators leave: over single cycles, near zero input, and behind detectors with an offset.
#include <algorithm>
#include <cstdio>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "engine/ensemble/output_counts.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace {

scenario::Scenario quiet(scenario::ReadoutModel model = scenario::ReadoutModel::ideal) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = model;
    scenario.readout.detector_noise_relative = 0.0;
    scenario.noise_injection.turn_phase_rms_rad = 4.0;
    scenario.ensemble.seed = 47;
    return scenario;
}

/// Gyros with initial phases all around the fringe and amplitudes of unlike bands.
std::vector<gyro::Setup> gyros_at(double rate_deg_h, std::size_t count, double first_phase_rad) {
    std::vector<gyro::Setup> setups;
    for (std::size_t g = 0; g < count; ++g) {
        gyro::Setup setup = paper_device();
        setup.input_rate_deg_h = rate_deg_h;
        setup.initial_phase_rad =
            first_phase_rad + units::two_pi * static_cast<double>(g) / static_cast<double>(count);
        setup.dither_peak_rate_deg_s *= 1.0 + 1e-4 * static_cast<double>(g);
        setups.push_back(setup);
    }
    return setups;
}

/// Output of one arm, minimum by minimum, in arcsec less the input's.
class Outputs {
   public:
    Outputs(const scenario::Scenario& scenario, const std::string& arm, std::vector<gyro::Setup> setups)
        : arms_{scenario::parse_arm(arm)}, block_(scenario, arms_, 0, std::move(setups)) {}

    /// Takes the next `cycles` cycles, in pieces of 64 as a run does, and gives each angle to `see(gyro, arcsec)`.
    template <class See>
    void run(std::int64_t cycles, const See& see) {
        for (std::int64_t done = 0; done < cycles; done += piece) {
            block_.advance(2 * piece);
            const auto counts = block_.counts(0);
            for (const simd::LaneCounts& row : counts) {
                const auto& setups = block_.setups();
                for (std::size_t g = 0; g < setups.size(); ++g) {
                    const double time_s = static_cast<double>(minimum_) / setups[g].dither_frequency_hz;
                    const double arcsec =
                        static_cast<double>(row[g]) * setups[g].scale_factor_arcsec / ensemble::counts_per_fringe;
                    see(g, arcsec - setups[g].input_rate_deg_h * time_s);
                }
                ++minimum_;
            }
        }
    }
    double cycle_s() const { return 1.0 / block_.setups().front().dither_frequency_hz; }
    std::size_t gyros() const { return block_.setups().size(); }

   private:
    static constexpr std::int64_t piece = 64;
    std::vector<scenario::Arm> arms_;
    ensemble::GyroBlock block_;
    std::int64_t minimum_ = 0;
};

/// Largest rate error over a single cycle [deg/h], in the first piece of 64 cycles, up to 1 s, and after.
struct Worst {
    double first_piece = 0.0;
    double first_second = 0.0;
    double later = 0.0;
    void take(const Worst& other) {
        first_piece = std::max(first_piece, other.first_piece);
        first_second = std::max(first_second, other.first_second);
        later = std::max(later, other.later);
    }
};

Worst worst_cycle(const std::string& arm, double rate_deg_h, double first_phase_rad, std::int64_t cycles) {
    Outputs outputs(quiet(), arm, gyros_at(rate_deg_h, simd::lanes, first_phase_rad));
    Worst worst;
    std::vector<double> last(outputs.gyros());
    std::vector<std::int64_t> seen(outputs.gyros());
    outputs.run(cycles, [&](std::size_t g, double arcsec) {
        const double error = std::abs(arcsec - last[g]) / outputs.cycle_s();
        last[g] = arcsec;
        const std::int64_t cycle = seen[g]++;
        if (cycle == 0) return;
        double& of = cycle < 64 ? worst.first_piece : cycle < 128 ? worst.first_second : worst.later;
        of = std::max(of, error);
    });
    return worst;
}

TEST(RateErrors, Probe) {
    for (const char* arm : {"compensated_exact", "noise_injected+compensated_exact", "compensated", "noise_injected+compensated"}) {
        Worst all;
        for (const double rate : {0.0, 1e-3, 0.1, 1.0, 2.6, 2.7, 15.0, 31.0, 62.34, 100.0, 124.0, 200.0, 300.0, 400.0, 500.0}) {
            Worst here;
            for (const double phase : {0.0, 0.13}) here.take(worst_cycle(arm, rate, phase, 2048));
            std::printf("%s %g: first piece %.3g, second %.3g, later %.3g deg/h\n", arm, rate, here.first_piece, here.first_second, here.later);
            all.take(here);
        }
        std::printf("%s ALL: first piece %.3g, second %.3g, later %.3g deg/h\n", arm, all.first_piece, all.first_second, all.later);
    }
}

TEST(RateErrors, ProbeBand) {
    for (const char* arm : {"uncompensated", "compensated", "compensated_exact"}) {
        for (const double rate : {0.0, 1e-5, 2e-5, 5e-5, 1e-4, 2e-4, 3e-4, 5e-4, 1e-3, 1e-2, 0.1, 1.0, 2.0, 2.7, 3.1}) {
            for (const double asym : {0.0, 0.001}) {
            auto setups = gyros_at(rate, simd::lanes, 0.0);
            for (auto& s : setups) s.dither_asymmetry_ratio = asym;
            Outputs outputs(quiet(), arm, setups);
            std::vector<double> first(16), last(16);
            outputs.run(6400, [&](std::size_t g, double x) { last[g] = x; });
            first = last;
            outputs.run(6400, [&](std::size_t g, double x) { last[g] = x; });
            double lo = 1e9, hi = -1e9;
            for (std::size_t g = 0; g < 16; ++g) {
                const double e = (last[g] - first[g]) / (6400 * outputs.cycle_s());
                lo = std::min(lo, e); hi = std::max(hi, e);
            }
            std::printf("%s asym %g rate %g: error %.4g .. %.4g deg/h\n", arm, asym, rate, lo, hi);
            }
        }
    }
}

TEST(RateErrors, ProbeOffset) {
    for (const char* key : {"offset_sin", "offset_cos"}) {
        for (const char* arm : {"noise_injected", "noise_injected+compensated", "noise_injected+compensated_exact"}) {
            for (const double offset : {0.05, -0.05}) {
            auto scenario = quiet(scenario::ReadoutModel::instrument);
            scenario.effects["readout_ellipse"][key] = offset;
            auto setups = gyros_at(15.0, simd::lanes, 0.0);
            for (auto& s : setups) s.ellipse = key == std::string("offset_sin") ? gyro::Ellipse{0.0, offset, 0.0, 0.0} : gyro::Ellipse{0.0, 0.0, offset, 0.0};
            Outputs outputs(scenario, arm, setups);
            std::vector<double> last(16);
            const std::int64_t cycles = 64000;
            outputs.run(cycles, [&](std::size_t g, double x) { last[g] = x; });
            double mean = 0, sq = 0;
            for (double x : last) { const double r = x / (cycles * outputs.cycle_s()); mean += r / 16; sq += r * r / 16; }
            std::printf("%s %g %s: %.5g +- %.2g deg/h\n", key, offset, arm, mean, std::sqrt((sq - mean * mean) / 15));
            }
        }
    }
}

}  // namespace
}  // namespace ringlock::test
