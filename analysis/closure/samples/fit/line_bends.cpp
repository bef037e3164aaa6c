#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <vector>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

constexpr std::size_t most_pieces = options.samples.lines.pieces.back();
using Polynomials = std::array<double, FrequencyTrack::most + 1>;

/// Legendre polynomials. They are orthogonal, so that a start near the maximum converges in few steps.
Polynomials legendre(double x) {
    Polynomials p{1.0, x};
    for (std::size_t k = 1; k + 1 < p.size(); ++k) {
        const auto n = static_cast<double>(k);
        p[k + 1] = ((2.0 * n + 1.0) * x * p[k] - n * p[k - 1]) / (n + 1.0);
    }
    return p;
}

/// Sum over samples in which the phase of a line near the start changes little. Polynomials at x from -1 to 1.
struct Cell {
    Complex sum;
    double weight = 0.0;
    Polynomials at{};
};

std::vector<Cell> cells_about(const std::vector<double>& values, double rate_hz, const FrequencyTrack& start,
                              double half_width_hz) {
    const std::size_t n = values.size();
    const auto turns = line_phase(n, rate_hz, start);
    const auto length = std::max<std::size_t>(1, static_cast<std::size_t>(rate_hz / (16.0 * half_width_hz)));
    std::vector<Cell> cells((n + length - 1) / length);
    for (std::size_t i = 0; i < n; ++i) {
        if (values[i] == 0.0) continue;
        cells[i / length].sum += values[i] * std::polar(1.0, -turns[i]);
        cells[i / length].weight += 1.0;
    }
    for (std::size_t j = 0; j < cells.size(); ++j) {
        const double middle = static_cast<double>(j * length) + 0.5 * static_cast<double>(length - 1);
        cells[j].at = legendre((2.0 * middle - static_cast<double>(n - 1)) / static_cast<double>(n));
    }
    return cells;
}

/// Phase in cycles that is added to that of the start. Each piece of the record has an amplitude and phase of its own.
class Bending {
   public:
    Bending(const std::vector<Cell>& cells, std::size_t degree) : cells_(cells), degree_(degree) {
        by_ = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(degree));
    }

    /// Halves the number of pieces until the whole record is one.
    void run(std::size_t pieces) {
        for (; pieces >= 1; pieces /= 2) improve(pieces);
    }
    /// Power of the last pieces relative to that of the whole record.
    double power() const { return power_; }
    const Eigen::VectorXd& by() const { return by_; }

   private:
    struct Step {
        double power = 0.0;
        Eigen::VectorXd step;
    };
    /// Step of Gauss and Newton, with the best amplitude and phase of each piece.
    Step step_from(const Eigen::VectorXd& by, std::size_t pieces) const {
        const auto d = static_cast<Eigen::Index>(degree_);
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(d, d);
        Eigen::VectorXd right = Eigen::VectorXd::Zero(d);
        Step found;
        std::vector<Complex> turned(cells_.size());
        for (std::size_t p = 0; p < pieces; ++p) {
            const std::size_t first = cells_.size() * p / pieces;
            const std::size_t last = cells_.size() * (p + 1) / pieces;
            Complex sum = 0.0;
            double weight = 0.0;
            Eigen::VectorXd mean = Eigen::VectorXd::Zero(d);
            for (std::size_t j = first; j < last; ++j) {
                const auto at = Eigen::VectorXd::Map(cells_[j].at.data() + 1, d);
                turned[j] = cells_[j].sum * std::polar(1.0, -units::two_pi * by.dot(at));
                sum += turned[j];
                weight += cells_[j].weight;
                mean += cells_[j].weight * at;
            }
            if (!(weight > 0.0)) continue;
            found.power += std::norm(sum) / weight;
            const Complex amplitude = sum / weight;
            mean /= weight;
            for (std::size_t j = first; j < last; ++j) {
                const Eigen::VectorXd off = units::two_pi * (Eigen::VectorXd::Map(cells_[j].at.data() + 1, d) - mean);
                normal.noalias() += std::norm(amplitude) * cells_[j].weight * off * off.transpose();
                right += (std::conj(amplitude) * turned[j]).imag() * off;
            }
        }
        found.step = dense::MinimumNorm(normal).solve(right);
        return found;
    }
    void improve(std::size_t pieces) {
        constexpr int most = 20;
        constexpr double gained = 1e-6;
        Step now = step_from(by_, pieces);
        for (int round = 0; round < most; ++round) {
            bool better = false;
            const double before = now.power;
            for (double share = 1.0; share > 0.05 && !better; share *= 0.5) {
                const Eigen::VectorXd there = by_ + share * now.step;
                Step next = step_from(there, pieces);
                better = next.power > before;
                if (!better) continue;
                by_ = there;
                now = std::move(next);
            }
            if (!better || now.power < (1.0 + gained) * before) break;
        }
        power_ = now.power;
    }

    const std::vector<Cell>& cells_;
    std::size_t degree_;
    Eigen::VectorXd by_;
    double power_ = 0.0;
};

/// The start with the additional phase.
FrequencyTrack bent(FrequencyTrack track, const Eigen::VectorXd& by, double duration_s) {
    // Legendre polynomials in powers of x
    Eigen::MatrixXd powers = Eigen::MatrixXd::Zero(FrequencyTrack::most + 1, FrequencyTrack::most + 1);
    powers(0, 0) = powers(1, 1) = 1.0;
    for (Eigen::Index k = 1; k + 1 < powers.rows(); ++k) {
        const auto n = static_cast<double>(k);
        powers.row(k + 1) = -n / (n + 1.0) * powers.row(k - 1);
        powers.row(k + 1).tail(powers.cols() - 1) +=
            (2.0 * n + 1.0) / (n + 1.0) * powers.row(k).head(powers.cols() - 1);
    }
    const Eigen::VectorXd turns = powers.middleRows(1, by.size()).transpose() * by;
    for (std::size_t k = 0; k < FrequencyTrack::most; ++k) {
        track.coefficient(k) += turns(static_cast<Eigen::Index>(k) + 1) * FrequencyTrack::a_cycle(k, duration_s);
    }
    track.free = static_cast<std::size_t>(by.size());
    return track;
}

}  // namespace

double look_elsewhere_of_track(double chi2, double cycles, std::size_t coefficients) {
    constexpr double tracked = 2.0 * most_pieces * most_pieces;
    double trials = look_elsewhere_of_drift(chi2, cycles, tracked);
    for (std::size_t k = 3; k <= coefficients; ++k) {
        // With unit variance about the best phase the slope by a Legendre polynomial has the variance
        // (2 pi)^2/(2 k + 1).
        trials *= static_cast<double>(most_pieces) *
                  std::sqrt(units::two_pi * std::max(1.0, chi2) / (2.0 * static_cast<double>(k) + 1.0));
    }
    return trials;
}

FoundTrack follow_bends(const std::vector<double>& values, double rate_hz, const FoundLines& found) {
    const double duration_s = static_cast<double>(values.size()) / rate_hz;
    const FrequencyTrack start = FrequencyTrack::even(found.scattered_hz, found.scattered_drift_hz_per_s);
    const auto cells = cells_about(values, rate_hz, start, most_pieces / duration_s);
    double square = 0.0;
    for (const double x : values) square += x * x;
    double weight = 0.0;
    for (const Cell& cell : cells) weight += cell.weight;
    FoundTrack best;
    double most = 0.0;
    for (std::size_t degree = 3; degree <= FrequencyTrack::most; ++degree) {
        Bending bending(cells, degree);
        bending.run(most_pieces);
        const double chi2 = 2.0 * bending.power() * weight / square;
        const double worth = chi2 - options.samples.lines.bend * static_cast<double>(degree);
        if (!(worth > most)) continue;
        most = worth;
        best = {bent(start, bending.by(), duration_s), chi2};
    }
    return best;
}

}  // namespace ringlock::closure
