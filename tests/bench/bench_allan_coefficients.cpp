// How well noise coefficients are estimated: records with known noise, thousands of them, as Markdown.
//
//   bench_allan_coefficients [--quick] [BLOCK]
//
// Without a block all of them; `--list` names them; `--quick` takes a tenth of the records. Every record is made from
// its own seed, so that the figures do not depend on the number of threads.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <boost/math/distributions/beta.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/noise/fit.hpp"
#include "analysis/noise/model/shapes.hpp"
#include "tests/bench/exact_flicker.hpp"
#include "tests/bench/page.hpp"
#include "tests/unit/allan_support.hpp"

namespace {

using namespace ringlock;
using bench::head;
using bench::number;
using bench::row;
using noise::NoiseFit;
using test::Truth;

int share = 1;  // one record in so many

constexpr double tau0_s = 1.0;
constexpr double arw_unit = 1.0 / 60.0;  // arcsec/sqrt(s) to deg/sqrt(h)
constexpr double walk_unit = 60.0;       // arcsec/s/sqrt(s) to (deg/h)/sqrt(h)
constexpr double ramp_unit = 3600.0;     // arcsec/s^2 to (deg/h)/h

/// Like records that differ in their seeds.
struct Study {
    std::string name;
    std::size_t samples = 0;
    int records = 0;
    Truth truth;
};

/// Terms as strong as a good gyro has them over a day at 1 Hz or so: each dominates the Allan deviation somewhere.
Truth five() { return {.q = 0.5, .n = 0.3, .b = 0.1, .k = 0.0044, .r = 2e-4}; }

std::vector<NoiseFit> fits(const Study& study) {
    const bench::ExactFlicker flicker(study.samples);
    Truth without_flicker = study.truth;
    without_flicker.b = 0.0;
    std::vector<NoiseFit> out(static_cast<std::size_t>(std::max(1, study.records / share)));
    oneapi::tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t k) {
        Truth mine = without_flicker;
        random::Engine engine = random::make_engine({k, 6}, random::Purpose::initial_phase);
        boost::random::uniform_real_distribution<double> phase(0.0, 2.0 * std::numbers::pi);
        for (test::TrueLine& line : mine.lines) line.phase_rad = phase(engine);
        std::vector<double> angle = test::simulate_angle(mine, study.samples, tau0_s, k);
        if (study.truth.b > 0.0) {
            const std::vector<double> rates = flicker.rates(k);
            double sum = 0.0;
            for (std::size_t i = 0; i < rates.size(); ++i) {
                sum += study.truth.b * tau0_s * rates[i];
                angle[i + 1] += sum;
            }
        }
        out[k] = noise::fit_noise(angle, tau0_s);
    });
    return out;
}

/// Cramer-Rao bound of the relative standard deviation of Q, N, B and K, those that are there all together.
std::array<double, 4> bounds(const Study& study) {
    const Truth& t = study.truth;
    const std::array<double, 4> theta = {t.q * t.q, t.n * t.n, t.b * t.b, t.k * t.k};
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
    for (std::size_t j = 1; j < study.samples; ++j) {
        const double x = 0.5 * static_cast<double>(j) / static_cast<double>(study.samples);
        const noise::Shapes shape = noise::shapes(x, static_cast<double>(j));
        Eigen::Vector4d part;
        for (std::size_t i = 0; i < 4; ++i) part[static_cast<Eigen::Index>(i)] = theta[i] * shape[i];
        part /= part.sum();
        information += 0.5 * part * part.transpose();
    }
    const Eigen::Matrix4d covariance = information.completeOrthogonalDecomposition().pseudoInverse();
    std::array<double, 4> out{};
    for (Eigen::Index i = 0; i < 4; ++i) out[static_cast<std::size_t>(i)] = 0.5 * std::sqrt(covariance(i, i));
    return out;
}

/// Share with its 95 % interval (Clopper and Pearson).
std::string share_of(int hits, int of) {
    if (of == 0) return "-";
    const double a = hits;
    const double b = of - hits;
    const double lo = hits == 0 ? 0.0 : boost::math::quantile(boost::math::beta_distribution<>(a, b + 1.0), 0.025);
    const double hi = hits == of ? 1.0 : boost::math::quantile(boost::math::beta_distribution<>(a + 1.0, b), 0.975);
    const int digits = 100 * hits < 2 * of ? 2 : 1;
    return fmt::format("{:.{}f} % ({:.{}f} .. {:.{}f})", 100.0 * a / of, digits, 100.0 * lo, digits, 100.0 * hi,
                       digits);
}

struct Tally {
    int of = 0;
    int claimed = 0;
    int covered = 0;
    int limits = 0;
    int held = 0;
    double sum = 0.0;
    double sum2 = 0.0;

    void claim(double value, double lo, double hi, double truth) {
        ++claimed;
        covered += lo <= truth && truth <= hi ? 1 : 0;
        sum += value / truth;
        sum2 += value * value / (truth * truth);
    }
    void add(const noise::Coefficient& c, double truth) {
        ++of;
        if (c.resolved) {
            claim(*c.value, *c.lo, *c.hi, truth);
        } else if (c.hi) {
            ++limits;
            held += *c.hi >= truth ? 1 : 0;
        }
    }
    void add(const noise::Estimate& e, double truth) { claim(e.value, e.lo, e.hi, truth); }
    double mean() const { return sum / claimed; }
    double spread() const { return std::sqrt(std::max(0.0, sum2 - sum * sum / claimed) / (claimed - 1)); }
};

struct Named {
    const char* name;
    noise::Coefficient NoiseFit::*member;
    double Truth::*truth;
    double unit;
};
const std::array<Named, 5> names = {
    Named{"Q", &NoiseFit::quantization_arcsec, &Truth::q, 1.0},
    Named{"N", &NoiseFit::arw_deg_rt_h, &Truth::n, arw_unit},
    Named{"B", &NoiseFit::bias_instability_deg_h, &Truth::b, 1.0},
    Named{"K", &NoiseFit::rrw_deg_h_rt_h, &Truth::k, walk_unit},
    Named{"R", &NoiseFit::rate_ramp_deg_h_h, &Truth::r, ramp_unit},
};

void coefficients() {
    head({"record", "", "resolved", "68.27 % intervals that hold", "mean/truth", "sd/truth",
          "sd over Cramer-Rao bound"});
    for (const Study& study : {Study{"n = 8192", 8192, 2000, five()}, Study{"n = 32 768", 32768, 2000, five()},
                               Study{"n = 131 072", 131072, 2000, five()}}) {
        const std::vector<NoiseFit> all = fits(study);
        const std::array<double, 4> bound = bounds(study);
        for (std::size_t i = 0; i < names.size(); ++i) {
            Tally tally;
            const double truth = study.truth.*names[i].truth * names[i].unit;
            for (const NoiseFit& f : all) tally.add(f.*names[i].member, truth);
            const bool all_claimed = tally.claimed == tally.of;
            row({i == 0 ? fmt::format("{}, {} records", study.name, all.size()) : "", names[i].name,
                 share_of(tally.claimed, tally.of), share_of(tally.covered, tally.claimed), number(tally.mean(), 4),
                 number(tally.spread(), 4),
                 i < bound.size() ? number(tally.spread() / bound[i], 3) + (all_claimed ? "" : " (of the resolved)")
                                  : ""});
        }
    }
}

void false_claims() {
    head({"record", "records", "a sinusoid", "correlated noise", "withheld"});
    for (const Study& study :
         {Study{"Q, N, B, K, R; n = 32 768", 32768, 4000, five()}, Study{"Q, N, B, K, R; n = 4096", 4096, 8000, five()},
          Study{"N; n = 600", 600, 8000, {.n = 0.3}}, Study{"N; n = 128", 128, 8000, {.n = 0.3}},
          Study{"Q, N; n = 4096", 4096, 8000, {.q = 0.2, .n = 0.3}},
          Study{"N, B; n = 4096", 4096, 8000, {.n = 0.3, .b = 0.3}},
          Study{"N, K; n = 4096", 4096, 8000, {.n = 0.3, .k = 0.02}}}) {
        int lines = 0;
        int correlated = 0;
        int withheld = 0;
        const std::vector<NoiseFit> all = fits(study);
        for (const NoiseFit& f : all) {
            lines += f.sinusoids.empty() ? 0 : 1;
            correlated += f.correlated ? 1 : 0;
            withheld += f.described ? 0 : 1;
        }
        const auto of = static_cast<int>(all.size());
        row({study.name, std::to_string(of), share_of(lines, of), share_of(correlated, of), share_of(withheld, of)});
    }
}

void sinusoids() {
    head({"amplitude [deg/h]", "amplitude over its error", "frequency [Hz]", "found", "frequency held",
          "amplitude held", "amplitude mean/truth", "N held", "withheld"});
    const std::size_t n = 8192;
    for (const double frequency_hz : {0.003, 0.1234567, 0.4321}) {
        for (const double ratio : {5.0, 7.0, 10.0, 100.0, 10000.0}) {
            Study study{"", n, 1000, five()};
            const Truth& t = study.truth;
            const noise::Shapes shape = noise::shapes(frequency_hz * tau0_s);
            const double variance =
                t.q * t.q * shape[0] + t.n * t.n * shape[1] + t.b * t.b * shape[2] + t.k * t.k * shape[3];
            const double x = std::numbers::pi * frequency_hz * tau0_s;
            const double amplitude = ratio * std::sqrt(2.0 * variance / static_cast<double>(n)) * x / std::sin(x);
            study.truth.lines = {{.amplitude = amplitude, .frequency_hz = frequency_hz}};
            Tally frequency, size, arw;
            int found = 0;
            int withheld = 0;
            const std::vector<NoiseFit> all = fits(study);
            for (const NoiseFit& f : all) {
                withheld += f.described ? 0 : 1;
                arw.add(f.arw_deg_rt_h, t.n * arw_unit);
                for (const noise::Sinusoid& s : f.sinusoids) {
                    if (std::abs(s.frequency_hz.value - frequency_hz) > 1.0 / static_cast<double>(n)) continue;
                    ++found;
                    frequency.add(s.frequency_hz, frequency_hz);
                    size.add(s.rate_amplitude_deg_h, amplitude);
                }
            }
            const auto of = static_cast<int>(all.size());
            row({fmt::format("{:.3g}", amplitude), number(ratio, 0), fmt::format("{:g}", frequency_hz),
                 share_of(found, of), share_of(frequency.covered, frequency.claimed),
                 share_of(size.covered, size.claimed), number(size.mean(), 3), share_of(arw.covered, arw.claimed),
                 share_of(withheld, of)});
        }
    }
}

void correlated_noise() {
    head({"terms", "T_c [s]", "rms [deg/h]", "n", "found", "T_c held", "q_c held", "rms held", "N held", "N mean/truth",
          "withheld", "withheld or found"});
    struct Case {
        const char* terms;
        Truth truth;
        std::size_t samples;
    };
    const Truth white{.n = 0.3};
    for (const Case& c : {Case{"N", white, 4096}, Case{"Q, N, B, K, R", five(), 32768}}) {
        for (const double time_s : {3.0, 30.0, 200.0}) {
            for (const double rms : {0.05, 0.1, 0.3}) {
                Study study{"", c.samples, 1000, c.truth};
                study.truth.correlated_rms = rms;
                study.truth.correlation_time_s = time_s;
                Tally time, drive, size, arw;
                int found = 0;
                int withheld = 0;
                int seen = 0;
                const std::vector<NoiseFit> all = fits(study);
                for (const NoiseFit& f : all) {
                    withheld += f.described ? 0 : 1;
                    seen += !f.described || f.correlated ? 1 : 0;
                    arw.add(f.arw_deg_rt_h, c.truth.n * arw_unit);
                    if (!f.correlated) continue;
                    ++found;
                    time.add(f.correlated->correlation_time_s, time_s);
                    drive.add(f.correlated->amplitude_deg_h_rt_h, 60.0 * rms * std::sqrt(2.0 / time_s));
                    size.add(f.correlated->rms_rate_deg_h, rms);
                }
                const auto of = static_cast<int>(all.size());
                row({c.terms, number(time_s, 0), number(rms, 2), std::to_string(c.samples), share_of(found, of),
                     share_of(time.covered, time.claimed), share_of(drive.covered, drive.claimed),
                     share_of(size.covered, size.claimed), share_of(arw.covered, arw.claimed), number(arw.mean(), 3),
                     share_of(withheld, of), share_of(seen, of)});
            }
        }
    }
}

void limits() {
    head({"record", "", "truth", "not resolved", "95 % limits that hold", "of all records: a limit that does not"});
    for (const Study& study :
         {Study{"Q = 0.2, N = 0.004; n = 600", 600, 2000, {.q = 0.2, .n = 0.004}},
          Study{"Q, N, B, K, R; n = 4096", 4096, 2000, five()},
          Study{"N, weak Q, B, K, R; n = 4096", 4096, 2000, {.q = 0.05, .n = 0.3, .b = 0.03, .k = 0.001, .r = 1e-5}},
          Study{"N, weaker B, K; n = 32 768", 32768, 2000, {.n = 0.3, .b = 0.02, .k = 0.0003, .r = 1e-6}}}) {
        const std::vector<NoiseFit> all = fits(study);
        bool first = true;
        for (const Named& name : names) {
            const double truth = study.truth.*name.truth;
            if (!(truth > 0.0)) continue;
            Tally tally;
            for (const NoiseFit& f : all) tally.add(f.*name.member, truth * name.unit);
            if (tally.limits == 0) continue;
            row({first ? study.name : "", name.name, fmt::format("{:g}", truth),
                 share_of(tally.of - tally.claimed, tally.of), share_of(tally.held, tally.limits),
                 share_of(tally.limits - tally.held, tally.of)});
            first = false;
        }
    }
}

void duration() {
    head({"n", "five terms [ms]", "with two lines [ms]", "with correlated noise [ms]"});
    for (const std::size_t n : {600, 10000, 100000, 1000000}) {
        std::vector<std::string> cells = {std::to_string(n)};
        Truth lines = five();
        lines.lines = {{1.0, 0.1234, 0.3}, {0.5, 0.31, 1.0}};
        Truth correlated = five();
        correlated.correlated_rms = 0.5;
        correlated.correlation_time_s = 5.0;
        for (const Truth& truth : {five(), lines, correlated}) {
            const std::vector<double> angle = test::simulate_angle(truth, n, tau0_s, 1);
            double best_ms = 1e9;
            for (int k = 0; k < 3; ++k) {
                const auto begin = std::chrono::steady_clock::now();
                noise::fit_noise(angle, tau0_s);
                const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
                best_ms = std::min(best_ms, took.count());
            }
            cells.push_back(number(best_ms, 1));
        }
        row(cells);
    }
}

}  // namespace

int main(int argc, char** argv) {
    std::string wanted;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument == "--quick") {
            share = 10;
        } else {
            wanted = argument;
        }
    }
    const std::vector<bench::Block> blocks = {
        {"coefficients", coefficients},
        {"false-claims", false_claims},
        {"sinusoids", sinusoids},
        {"correlated", correlated_noise},
        {"limits", limits},
        {"duration", duration},
    };
    return bench::print_blocks("bench_allan_coefficients", wanted, blocks);
}
