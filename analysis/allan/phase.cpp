#include "analysis/allan/phase.hpp"

#include <cmath>

namespace ringlock::allan {
namespace {

struct Sum {
    double value;
    double error;  ///< value + error is the exact sum
};

Sum two_sum(double a, double b) {
    const double s = a + b;
    const double bb = s - a;
    return {s, (a - (s - bb)) + (b - bb)};
}

std::vector<double> without_line(std::span<const double> phase) {
    std::vector<double> out(phase.size());
    if (phase.empty()) return out;
    const double first = phase.front();
    const double slope = phase.size() > 1 ? (phase.back() - first) / static_cast<double>(phase.size() - 1) : 0.0;
    for (std::size_t i = 0; i < phase.size(); ++i) {
        const Sum d = two_sum(phase[i], -first);
        out[i] = std::fma(-slope, static_cast<double>(i), d.value) + d.error;
    }
    return out;
}

std::vector<double> accumulated(std::span<const double> steps, double scale) {
    double total = 0.0;
    for (const double s : steps) total += s;
    const double mean = steps.empty() ? 0.0 : total / static_cast<double>(steps.size());
    std::vector<double> out(steps.size() + 1);
    Sum running{0.0, 0.0};
    out[0] = 0.0;
    for (std::size_t i = 0; i < steps.size(); ++i) {
        const Sum step = two_sum(steps[i], -mean);
        const Sum next = two_sum(running.value, step.value);
        running = {next.value, running.error + next.error + step.error};
        out[i + 1] = (running.value + running.error) * scale;
    }
    return out;
}

}  // namespace

std::vector<double> centred_phase(std::span<const double> data, Kind kind, double tau0_s) {
    switch (kind) {
        case Kind::phase:
            return without_line(data);
        case Kind::increment:
            return accumulated(data, 1.0);
        case Kind::rate:
            return accumulated(data, tau0_s);
    }
    return {};
}

}  // namespace ringlock::allan
