#include "analysis/closure/decision.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/closure/chance.hpp"

namespace ringlock::closure {

Rows rows_that_choose(std::size_t rows) {
    constexpr std::size_t blocks = 40;
    constexpr std::size_t in_a_row = 10;
    constexpr std::size_t reported = 5;
    Rows out(rows);
    for (std::size_t i = 0; i < rows; ++i) out[i] = i * blocks / rows % in_a_row == reported ? 0 : 1;
    return out;
}

std::string experiment_for(const std::string& effect, const std::vector<std::string>& others) {
    const auto has = [&](std::string_view name) {
        return effect == name || std::find(others.begin(), others.end(), name) != others.end();
    };
    if (has("dither_residue")) {
        return "declare the dither's frequency if the record does not, or record with another dither frequency or "
               "sampling rate";
    }
    if (has("bias_temperature") || has("lockin_temperature")) {
        return "record with the temperature changed against time: held, then stepped up and down";
    }
    if (has("scale_factor_error")) return "record at three input rates or more, of both signs";
    if (has("dither_asymmetry") && has("dither_second_harmonic")) {
        return "record the accelerations on both sides of the turns";
    }
    if (has("detector_phase_offset") || has("lockin_second_harmonic") || has("lockin_turn_asymmetry")) {
        return "record with more injected noise, so that all phases come at all turns, or for longer";
    }
    if (has("bias_step") || has("bias_ramp") || has("rate_random_walk") || has("bias_instability") ||
        has("quantum_noise")) {
        return "record for longer: their Allan deviations and their courses in time part with the averaging time";
    }
    return "record for longer";
}

Verdict verdict_of(const Closure& closure) {
    if (closure.unexplained) return Verdict::unexplained;
    return closure.steps.empty() ? Verdict::nothing_missing : Verdict::closed;
}

Correlations correlations_of(const std::vector<double>& innovations, const Rows& rows) {
    Correlations found;
    for (std::size_t k = 1; k < found.root.size(); ++k) {
        double sum = 0.0;
        double weight = 0.0;
        for (std::size_t i = k; i < innovations.size(); ++i) {
            if (!rows[i] || !rows[i - k]) continue;
            const double product = innovations[i] * innovations[i - k];
            sum += product;
            weight += product * product;
        }
        if (weight > 0.0) found.root[k] = sum / std::sqrt(weight);
    }
    return found;
}

ResidualTest Correlations::test(Where where, std::string view) const {
    double chi2 = 0.0;
    for (const double r : root) chi2 += r * r;
    return {where, std::move(view), chi2_tail(chi2, static_cast<int>(root.size()) - 1),
            fmt::format("first correlations {:.2f}, {:.2f}, {:.2f} standard errors", root[1], root[2], root[3])};
}

Squares squares_of(const std::vector<double>& innovations, const Rows& rows) {
    double mean = 0.0;
    double fourth = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < innovations.size(); ++i) {
        if (!rows[i]) continue;
        const double square = innovations[i] * innovations[i];
        mean += square;
        fourth += square * square;
        count += 1.0;
    }
    mean /= count;
    return {mean, std::max(fourth / count - mean * mean, 1e-12)};
}

ResidualTest size_over_time(const std::vector<double>& innovations, const Rows& rows, std::size_t stretches,
                            double fewest) {
    const std::size_t n = innovations.size();
    const auto [mean, variance] = squares_of(innovations, rows);
    double chi2 = 0.0;
    int freedom = -1;
    for (std::size_t s = 0; s < stretches; ++s) {
        double sum = 0.0;
        double k = 0.0;
        for (std::size_t i = n * s / stretches; i < n * (s + 1) / stretches; ++i) {
            if (!rows[i]) continue;
            sum += innovations[i] * innovations[i] - mean;
            k += 1.0;
        }
        if (k < fewest) continue;
        chi2 += sum * sum / (k * variance);
        ++freedom;
    }
    return {Where::time, "size of the residual in stretches of the record", chi2_tail(chi2, freedom), ""};
}

}  // namespace ringlock::closure
