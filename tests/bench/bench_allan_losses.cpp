// How well noise coefficients are estimated from records with lost samples, as Markdown.
//
//   bench_allan_losses [--records N] [--only NAME] [BLOCK]
//
// Without a block all of them; `--list` names them; `--only` takes the records whose names have that part. Every record
// and its losses are made from its own seed, so that the figures do not depend on the number of threads.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "analysis/noise/fit.hpp"
#include "analysis/noise/losses/fit.hpp"
#include "tests/bench/exact_flicker.hpp"
#include "tests/bench/page.hpp"
#include "tests/unit/allan_losses.hpp"
#include "tests/unit/allan_support.hpp"

namespace {

using namespace ringlock;
using allan::Kind;
using bench::head;
using bench::number;
using bench::row;
using noise::NoiseFit;
using test::Losses;
using test::Truth;

int records = 2000;
std::string only;  ///< a part of the names of the records to be taken

struct Study {
    std::string name;
    std::size_t samples = 0;
    Truth truth;
    Losses losses;
    Kind kind = Kind::rate;
};

std::vector<double> angle_of(const Study& study, const bench::ExactFlicker& flicker, std::size_t k) {
    Truth without_flicker = study.truth;
    without_flicker.b = 0.0;
    std::vector<double> angle = test::simulate_angle(without_flicker, study.samples, 1.0, k);
    if (study.truth.b > 0.0) {
        double sum = 0.0;
        const std::vector<double> rates = flicker.rates(k);
        for (std::size_t i = 0; i < rates.size(); ++i) angle[i + 1] += sum += study.truth.b * rates[i];
    }
    return angle;
}

std::vector<NoiseFit> fits(const Study& study) {
    const bench::ExactFlicker flicker(study.samples);
    std::vector<NoiseFit> out(static_cast<std::size_t>(records));
    oneapi::tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t k) {
        std::vector<double> data = angle_of(study, flicker, k);
        if (study.kind != Kind::phase) data = test::rates_of_angle(data);
        test::lose(study.losses, k, data);
        out[k] = noise::fit_noise(allan::phase_of(data, study.kind, 1.0), 1.0);
    });
    return out;
}

struct Named {
    const char* name;
    noise::Coefficient NoiseFit::*member;
    double Truth::*truth;
    double unit;
};
const std::array<Named, 4> names = {
    Named{"Q", &NoiseFit::quantization_arcsec, &Truth::q, 1.0},
    Named{"N", &NoiseFit::arw_deg_rt_h, &Truth::n, 1.0 / 60.0},
    Named{"B", &NoiseFit::bias_instability_deg_h, &Truth::b, 1.0},
    Named{"K", &NoiseFit::rrw_deg_h_rt_h, &Truth::k, 60.0},
};

/// The terms whose sizes a bound takes to be unknown.
enum class Unknown { terms_of_the_record, all_terms };

/// Standard deviation of Q, N, B and K that no unbiased estimate from the present rates can be below, over the truth
/// (over 1 where the truth is 0), with the mean unknown: from the dense covariance of these rates.
std::array<double, 4> bounds(const Study& study, Unknown unknown) {
    const auto n = static_cast<Eigen::Index>(study.samples);
    const Truth& t = study.truth;
    std::vector<double> there(study.samples + (study.kind == Kind::phase ? 1 : 0), 0.0);
    test::lose(study.losses, 0, there);
    const Eigen::MatrixXd seen = test::seen_rates(there, study.kind);
    const auto integral = [](double x) { return x == 0.0 ? 0.0 : -0.5 * x * x * (std::log(std::abs(x)) - 1.5) / M_PI; };
    std::vector<Eigen::MatrixXd> parts;
    std::vector<std::size_t> which;
    for (std::size_t term = 0; term < 4; ++term) {
        const std::array<double, 4> size = {t.q, t.n, t.b, t.k};
        if (unknown == Unknown::terms_of_the_record && !(size[term] > 0.0)) continue;
        const double unit = size[term] > 0.0 ? size[term] : 1.0;
        Eigen::MatrixXd c(n, n);
        for (Eigen::Index i = 0; i < n; ++i) {
            for (Eigen::Index j = 0; j < n; ++j) {
                const auto lag = static_cast<double>(std::abs(i - j));
                const std::array<double, 4> shape = {
                    lag == 0.0   ? 2.0
                    : lag == 1.0 ? -1.0
                                 : 0.0,
                    lag == 0.0 ? 1.0 : 0.0, integral(lag + 1.0) - 2.0 * integral(lag) + integral(lag - 1.0),
                    lag == 0.0 ? -1.0 / 6.0 : -0.5 * lag};  // -|t|/2, of the same contrasts as the random walk
                c(i, j) = unit * unit * shape[term];
            }
        }
        parts.push_back(seen * c * seen.transpose());
        which.push_back(term);
    }
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(seen.rows(), seen.rows());
    double largest = 0.0;
    for (std::size_t a = 0; a < parts.size(); ++a) {
        if (t.*names[which[a]].truth > 0.0) sum += parts[a];
    }
    largest = sum.cwiseAbs().maxCoeff();
    const Eigen::VectorXd one = seen * Eigen::VectorXd::Ones(n);
    sum += static_cast<double>(n) * largest * one * one.transpose();
    const Eigen::LDLT<Eigen::MatrixXd> factors(sum);
    const Eigen::VectorXd w = factors.solve(one);
    std::vector<Eigen::MatrixXd> scores;
    for (const Eigen::MatrixXd& part : parts) {
        Eigen::MatrixXd p = factors.solve(part);
        p -= w * (one.transpose() * p) / one.dot(w);
        scores.push_back(p);
    }
    const auto count = static_cast<Eigen::Index>(parts.size());
    Eigen::MatrixXd information(count, count);
    for (Eigen::Index a = 0; a < count; ++a) {
        for (Eigen::Index b = 0; b < count; ++b) {
            information(a, b) =
                0.5 *
                scores[static_cast<std::size_t>(a)].cwiseProduct(scores[static_cast<std::size_t>(b)].transpose()).sum();
        }
    }
    const Eigen::MatrixXd covariance = information.inverse();
    std::array<double, 4> out{};
    for (Eigen::Index a = 0; a < count; ++a)
        out[which[static_cast<std::size_t>(a)]] = 0.5 * std::sqrt(covariance(a, a));
    return out;
}

struct Tally {
    int claimed = 0;
    int covered = 0;
    double sum = 0.0;
    double sum2 = 0.0;
    double width = 0.0;
    void add(const noise::Coefficient& c, double truth) {
        if (!c.resolved) return;
        ++claimed;
        covered += *c.lo <= truth && truth <= *c.hi ? 1 : 0;
        sum += *c.value / truth;
        sum2 += *c.value * *c.value / (truth * truth);
        width += 0.5 * (*c.hi - *c.lo) / truth;
    }
    double mean() const { return sum / claimed; }
    double spread() const { return std::sqrt(std::max(0.0, sum2 - sum * sum / claimed) / (claimed - 1)); }
};

Tally tally_of(const std::vector<NoiseFit>& all, const Named& name, const Truth& truth) {
    Tally out;
    for (const NoiseFit& f : all) out.add(f.*name.member, truth.*name.truth * name.unit);
    return out;
}

void print(const Study& study) {
    if (!only.empty() && study.name.find(only) == std::string::npos) return;
    const std::vector<NoiseFit> all = fits(study);
    Study unbroken = study;
    unbroken.samples = all.front().samples;
    unbroken.losses = {};
    const std::vector<NoiseFit> as_many = fits(unbroken);
    const std::array<double, 4> bound = bounds(study, Unknown::terms_of_the_record);
    int withheld = 0;
    for (const NoiseFit& f : all) withheld += f.described ? 0 : 1;
    bool first = true;
    for (std::size_t i = 0; i < names.size(); ++i) {
        if (!(study.truth.*names[i].truth > 0.0)) continue;
        const Tally mine = tally_of(all, names[i], study.truth);
        const Tally whole = tally_of(as_many, names[i], study.truth);
        row({first ? study.name : "", names[i].name, fmt::format("{:.1f} %", 100.0 * mine.claimed / records),
             fmt::format("{:.1f} %", 100.0 * mine.covered / std::max(1, mine.claimed)),
             fmt::format("{:.1f} %", 100.0 * whole.covered / std::max(1, whole.claimed)), number(mine.mean(), 4),
             number(mine.spread(), 4), number(mine.spread() / whole.spread(), 3), number(mine.spread() / bound[i], 3),
             number(mine.width / mine.claimed / mine.spread(), 3),
             first ? fmt::format("{:.1f} %", 100.0 * withheld / records) : ""});
        first = false;
    }
    for (const Named& name : names) {
        if (study.truth.*name.truth > 0.0) continue;
        const auto claims =
            std::count_if(all.begin(), all.end(), [&](const NoiseFit& f) { return (f.*name.member).resolved; });
        if (claims == 0) continue;
        const double percent = 100.0 * static_cast<double>(claims) / records;
        row({"", name.name, fmt::format("{:.1f} %", percent), "absent", "", "", "", "", "", "", ""});
    }
}

void titles() {
    fmt::print("{} records of each kind.\n\n", records);
    head({"record", "", "resolved", "68.27 % intervals that hold", "those of as many unbroken data", "mean/truth",
          "sd/truth", "sd over that of as many unbroken data", "sd over the Cramer-Rao bound of the present data",
          "half width over sd", "withheld"});
}

constexpr std::size_t samples = 1000;
constexpr std::size_t samples_of_drift = 3000;  ///< each term is then found in nearly all records

void white() {
    titles();
    for (const double share : {0.001, 0.01, 0.12, 0.3, 0.5}) {
        print({fmt::format("N; {:g} % single samples of rate", 100.0 * share), samples, {.n = 0.3}, {share, 1}});
    }
    print({"N; 12 % in stretches of 20", samples, {.n = 0.3}, {0.12, 20}});
    print({"N; 50 % in stretches of 100", samples, {.n = 0.3}, {0.5, 100}});
    print({"N; 12 % single samples of phase", samples, {.n = 0.3}, {0.12, 1}, Kind::phase});
    print({"N; 50 % single samples of phase", samples, {.n = 0.3}, {0.5, 1}, Kind::phase});
}

const Truth walk{.n = 0.3, .k = 0.03};
const Truth flicker{.n = 0.3, .b = 0.3};
const Truth ramp{.n = 0.3, .r = 5e-4};

Study drifting(const char* terms, const Truth& truth, const Losses& losses) {
    return {fmt::format("{}; {:g} % in pieces of {}", terms, 100.0 * losses.share, losses.length), samples_of_drift,
            truth, losses};
}

void drift() {
    titles();
    for (const double share : {0.12, 0.5}) {
        for (const std::size_t length : {1, 50}) {
            print(drifting("N, K", walk, {share, length}));
            print(drifting("N, B", flicker, {share, length}));
            print(drifting("N, R", ramp, {share, length}));
        }
    }
}

/// How much less exactly N can be known from a record with losses than from as many unbroken data, where the sizes of
/// all terms are unknown: a loss of single rates takes more from the difference between white and angle noise.
void drift_bounds() {
    head({"record", "bound of N, relative", "that of as many unbroken data", "ratio"});
    for (const double share : {0.12, 0.5}) {
        for (const std::size_t length : {1, 50}) {
            for (const auto& [terms, truth] : {std::pair{"N, K", walk}, std::pair{"N, B", flicker}}) {
                const Study study = drifting(terms, truth, {share, length});
                if (study.name.find(only) == std::string::npos) continue;
                Study unbroken = study;
                unbroken.losses = {};
                std::vector<double> there(study.samples, 0.0);
                test::lose(study.losses, 0, there);
                unbroken.samples = static_cast<std::size_t>(
                    std::count_if(there.begin(), there.end(), [](double rate) { return std::isfinite(rate); }));
                const double mine = bounds(study, Unknown::all_terms)[1];
                const double whole = bounds(unbroken, Unknown::all_terms)[1];
                row({study.name, number(mine, 3), number(whole, 3), number(mine / whole, 3)});
            }
        }
    }
}

void angle_noise() {
    titles();
    const Truth both{.q = 0.3, .n = 0.4};
    for (const double share : {0.01, 0.12, 0.5}) {
        for (const std::size_t length : {1, 20}) {
            const std::string lost = fmt::format("{:g} % in pieces of {}", 100.0 * share, length);
            print({"Q, N; " + lost + ", rate", samples_of_drift, both, {share, length}});
            print({"Q, N; " + lost + ", phase", samples_of_drift, both, {share, length}, Kind::phase});
        }
    }
}

void duration() {
    head({"n", "lost", "terms", "seconds"});
    for (const std::size_t n : {1000, 10000, 100000}) {
        for (const double share : {0.01, 0.12, 0.5}) {
            for (const auto& [name, truth] :
                 {std::pair{"N", Truth{.n = 0.3}},
                  std::pair{"Q, N, B, K", Truth{.q = 0.5, .n = 0.3, .b = 0.1, .k = 0.0044}}}) {
                std::vector<double> data = test::rates_of_angle(test::simulate_angle(truth, n, 1.0, 1));
                test::lose({share, 1}, 1, data);
                const auto begin = std::chrono::steady_clock::now();
                noise::fit_noise(allan::phase_of(data, Kind::rate, 1.0), 1.0);
                const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
                row({std::to_string(n), fmt::format("{:g} %", 100.0 * share), name, number(took.count(), 2)});
            }
        }
    }
}

}  // namespace

int main(int argc, char** argv) {
    std::string wanted;
    for (int i = 1; i < argc; ++i) {
        const std::string argument = argv[i];
        if (argument == "--records" && i + 1 < argc) {
            records = std::stoi(argv[++i]);
        } else if (argument == "--only" && i + 1 < argc) {
            only = argv[++i];
        } else {
            wanted = argument;
        }
    }
    const std::vector<bench::Block> blocks = {{"lost-white", white},
                                              {"lost-drift", drift},
                                              {"lost-drift-bounds", drift_bounds},
                                              {"lost-angle-noise", angle_noise},
                                              {"lost-duration", duration}};
    return bench::print_blocks("bench_allan_losses", wanted, blocks);
}
