// Faults in measured data: how often each is found, what the noise coefficients are worth then, and what the search
// costs where there is nothing to find. Thousands of records with known noise, as Markdown.
//
//   bench_allan_findings [--quick] [BLOCK]
//
// Without a block all of them; `--list` names them; `--quick` takes a tenth of the records. Every record is made from
// its own seed, so that the figures do not depend on the number of threads.
#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <boost/random/uniform_real_distribution.hpp>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>
#include <string>
#include <vector>

#include "analysis/allan_run/search_and_fit.hpp"
#include "analysis/findings/clean_fit.hpp"
#include "analysis/findings/values.hpp"
#include "tests/bench/page.hpp"
#include "tests/unit/allan_support.hpp"

namespace {

using namespace ringlock;
using bench::head;
using bench::number;
using bench::row;
using findings::CleanFit;
using test::Truth;

constexpr double tau0_s = 1.0;
constexpr double arw_unit = 1.0 / 60.0;  // arcsec/sqrt(s) to deg/sqrt(h)
constexpr std::size_t samples = 2000;
int records = 2000;

using Engine = random::Engine;

double uniform(Engine& engine, double lo, double hi) {
    return boost::random::uniform_real_distribution<double>(lo, hi)(engine);
}

double log_uniform(Engine& engine, double lo, double hi) {
    return std::exp(uniform(engine, std::log(lo), std::log(hi)));
}

Engine engine_of(std::size_t record, std::uint64_t kind) {
    return random::make_engine({record, kind}, random::Purpose::initial_phase);
}

/// Calls `make` for every record, in parallel; results in order.
template <class Result>
std::vector<Result> of_records(const std::function<Result(std::size_t)>& make) {
    std::vector<Result> out(static_cast<std::size_t>(records));
    oneapi::tbb::parallel_for(std::size_t{0}, out.size(), [&](std::size_t k) { out[k] = make(k); });
    return out;
}

/// White noise of 1 deg/h a sample in front of any other.
constexpr Truth white{.n = 1.0};

struct Kind {
    std::string name;
    Truth truth;
};

/// Mixtures of the five noises in which each is weak, strong or absent; the sampling interval is 1 s.
std::vector<Kind> clean_kinds() {
    return {{"white rate", white},
            {"white, walk 0.01", {.n = 1.0, .k = 0.01}},
            {"white, walk 0.05", {.n = 1.0, .k = 0.05}},
            {"white, walk 0.3", {.n = 1.0, .k = 0.3}},
            {"white, flicker 0.3", {.n = 1.0, .b = 0.3}},
            {"quantisation, white", {.q = 2.0, .n = 1.0}},
            {"all five", {.q = 1.0, .n = 1.0, .b = 0.2, .k = 0.03, .r = 1e-3}},
            {"white, ramp 0.002", {.n = 1.0, .r = 2e-3}}};
}

double spread(const std::vector<double>& values) {
    double sum = 0.0;
    double sum2 = 0.0;
    for (const double v : values) {
        sum += v;
        sum2 += v * v;
    }
    const auto n = static_cast<double>(values.size());
    return n > 1.0 ? std::sqrt((sum2 - sum * sum / n) / (n - 1.0)) : 0.0;
}

const std::vector<std::pair<const char*, noise::Coefficient noise::NoiseFit::*>> coefficients = {
    {"Q", &noise::NoiseFit::quantization_arcsec},
    {"N", &noise::NoiseFit::arw_deg_rt_h},
    {"B", &noise::NoiseFit::bias_instability_deg_h},
    {"K", &noise::NoiseFit::rrw_deg_h_rt_h},
    {"R", &noise::NoiseFit::rate_ramp_deg_h_h}};

void clean() {
    struct Both {
        CleanFit searched;
        noise::NoiseFit plain;
    };
    head({"noise", "records with findings", "spread of N over that without search", "Q", "N", "B", "K", "R claimed"});
    std::uint64_t seed = 100;
    int found = 0;
    int all = 0;
    for (const Kind& kind : clean_kinds()) {
        ++seed;
        const auto fits = of_records<Both>([&](std::size_t k) {
            const std::vector<double> angle = test::simulate_angle(kind.truth, samples, tau0_s, 1000000 * seed + k);
            return Both{findings::fit_without_events(angle, tau0_s, false), noise::fit_noise(angle, tau0_s)};
        });
        int with_findings = 0;
        std::vector<double> searched;
        std::vector<double> plain;
        std::map<std::string, std::pair<int, int>> claims;
        for (const Both& both : fits) {
            with_findings += both.searched.searched.findings.empty() ? 0 : 1;
            for (const auto& [name, member] : coefficients) {
                claims[name].first += both.searched.noise.described && (both.searched.noise.*member).resolved ? 1 : 0;
                claims[name].second += both.plain.described && (both.plain.*member).resolved ? 1 : 0;
            }
            if (!both.plain.arw_deg_rt_h.value || !both.searched.noise.arw_deg_rt_h.value) continue;
            searched.push_back(*both.searched.noise.arw_deg_rt_h.value);
            plain.push_back(*both.plain.arw_deg_rt_h.value);
        }
        found += with_findings;
        all += records;
        std::vector<std::string> cells{kind.name, fmt::format("{} of {}", with_findings, records),
                                       fmt::format("{:.4f}", spread(searched) / spread(plain))};
        for (const auto& [name, member] : coefficients) {
            cells.push_back(fmt::format("{} (before {})", claims[name].first, claims[name].second));
        }
        row(cells);
    }
    fmt::print("\n{} of {} clean records have a finding.\n", found, all);
}

/// How often N is claimed, its interval misses the truth, and K is claimed.
struct Tally {
    int of = 0;
    int claimed = 0;
    int outside = 0;
    int walks = 0;
    int found = 0;

    void add(const CleanFit& fit, bool was_found) {
        ++of;
        found += was_found ? 1 : 0;
        if (!fit.noise.described) return;
        walks += fit.noise.rrw_deg_h_rt_h.resolved ? 1 : 0;
        const noise::Coefficient& n = fit.noise.arw_deg_rt_h;
        if (!n.resolved) return;
        ++claimed;
        outside += *n.lo <= arw_unit && arw_unit <= *n.hi ? 0 : 1;
    }
    void print(const std::string& name) const {
        const auto percent = [](int part, int whole) { return whole == 0 ? 0.0 : 100.0 * part / whole; };
        row({name, fmt::format("{}", of), fmt::format("{:.1f} %", percent(found, of)),
             fmt::format("{:.1f} %", percent(claimed, of)), fmt::format("{:.1f} %", percent(outside, claimed)),
             fmt::format("{:.2f} %", percent(walks, of))});
    }
};

void head_of_faults(const std::string& fault) {
    head({fault, "records", "found", "N claimed", "truth outside its 68.27 % interval, of those", "K claimed"});
}

struct Faulty {
    double size = 0.0;
    bool found = false;
    CleanFit fit;
};

void print_by_size(const std::vector<Faulty>& faulty, const std::vector<double>& bounds,
                   const std::string& unit = "sigma") {
    Tally pooled;
    for (std::size_t i = 0; i + 1 < bounds.size(); ++i) {
        Tally tally;
        for (const Faulty& one : faulty) {
            if (one.size >= bounds[i] && one.size < bounds[i + 1]) tally.add(one.fit, one.found);
        }
        tally.print(fmt::format("{} to {} {}", number(bounds[i]), number(bounds[i + 1]), unit));
    }
    for (const Faulty& one : faulty) pooled.add(one.fit, one.found);
    pooled.print("all");
}

std::vector<double> white_rates(std::uint64_t seed) {
    const std::vector<double> angle = test::simulate_angle(white, samples, tau0_s, seed);
    std::vector<double> rate;
    for (std::size_t i = 1; i < angle.size(); ++i) rate.push_back(angle[i] - angle[i - 1]);
    return rate;
}

std::vector<double> angle_of(const std::vector<double>& rate) {
    std::vector<double> angle{0.0};
    for (const double r : rate) angle.push_back(angle.back() + r * tau0_s);
    return angle;
}

bool has(const CleanFit& fit, findings::Kind kind) {
    for (const findings::Finding& found : fit.searched.findings) {
        if (found.kind == kind) return true;
    }
    return false;
}

void glitches() {
    head_of_faults("one to five glitches");
    const auto faulty = of_records<Faulty>([](std::size_t k) {
        Engine engine = engine_of(k, 21);
        std::vector<double> rate = white_rates(21000000 + k);
        const double size = log_uniform(engine, 5.0, 200.0);
        const int count = 1 + static_cast<int>(uniform(engine, 0.0, 5.0));
        for (int i = 0; i < count; ++i) {
            rate[static_cast<std::size_t>(uniform(engine, 0.0, samples))] +=
                uniform(engine, 0.0, 1.0) < 0.5 ? size : -size;
        }
        const CleanFit fit = findings::fit_without_events(angle_of(rate), tau0_s, false);
        return Faulty{size, has(fit, findings::Kind::outlier), fit};
    });
    print_by_size(faulty, {5.0, 6.0, 10.0, 30.0, 200.0});
}

void jumps() {
    head_of_faults("a jump of the rate");
    const auto faulty = of_records<Faulty>([](std::size_t k) {
        Engine engine = engine_of(k, 22);
        std::vector<double> rate = white_rates(22000000 + k);
        const double size = log_uniform(engine, 1.0, 10.0);
        const auto at = static_cast<std::size_t>(uniform(engine, 20.0, samples - 20.0));
        const double sign = uniform(engine, 0.0, 1.0) < 0.5 ? 1.0 : -1.0;
        for (std::size_t i = at; i < samples; ++i) rate[i] += sign * size;
        const CleanFit fit = findings::fit_without_events(angle_of(rate), tau0_s, false);
        return Faulty{size, has(fit, findings::Kind::jump), fit};
    });
    print_by_size(faulty, {1.0, 1.5, 2.0, 3.0, 5.0, 10.0});
}

void wraps() {
    head_of_faults("a counter that wraps");
    const auto faulty = of_records<Faulty>([](std::size_t k) {
        Engine engine = engine_of(k, 23);
        std::vector<double> angle = test::simulate_angle(white, samples, tau0_s, 23000000 + k);
        const double modulus = std::exp2(std::floor(uniform(engine, 10.0, 20.0)));
        const double rate = modulus / uniform(engine, 30.0, 1500.0);
        const double start = uniform(engine, 0.0, modulus);
        for (std::size_t i = 0; i < angle.size(); ++i) {
            const double count = std::nearbyint(16.0 * angle[i] + start + rate * static_cast<double>(i));
            angle[i] = count - modulus * std::floor(count / modulus);
        }
        const auto found = findings::find_wraps(angle);
        if (found) findings::unwrap(*found, angle);
        for (double& a : angle) a /= 16.0;
        return Faulty{modulus, found && found->modulus == modulus, findings::fit_without_events(angle, tau0_s, true)};
    });
    Tally tally;
    for (const Faulty& one : faulty) tally.add(one.fit, one.found);
    tally.print("modulus 2^10 to 2^19");
}

/// The analysis of the data themselves, in which values are searched for before their noise.
CleanFit analysed(const std::vector<double>& rate) {
    allan_run::AllanOutput out;
    out.tau0_s = tau0_s;
    out.n = rate.size();
    allan_run::search_and_fit(rate, {}, allan::phase_of(rate, allan::Kind::rate, tau0_s), allan::Kind::rate, 1.0, out);
    return {{.findings = out.findings, .rate = {}}, *out.noise, {}};
}

void held() {
    head_of_faults("an output that is held, samples");
    const auto faulty = of_records<Faulty>([](std::size_t k) {
        Engine engine = engine_of(k, 24);
        std::vector<double> rate = white_rates(24000000 + k);
        const double length = std::floor(log_uniform(engine, 10.0, 500.0));
        const auto at = static_cast<std::size_t>(uniform(engine, 0.0, samples - length));
        std::fill_n(rate.begin() + static_cast<std::ptrdiff_t>(at), static_cast<std::size_t>(length), rate[at]);
        const CleanFit fit = analysed(rate);
        return Faulty{length, has(fit, findings::Kind::repeated), fit};
    });
    print_by_size(faulty, {10.0, 20.0, 50.0, 150.0, 500.0}, "samples");
}

void clipped() {
    head_of_faults("an output that is clipped");
    const auto faulty = of_records<Faulty>([](std::size_t k) {
        Engine engine = engine_of(k, 25);
        std::vector<double> rate = white_rates(25000000 + k);
        const double limit = uniform(engine, 1.5, 4.0);
        const double mean = std::accumulate(rate.begin(), rate.end(), 0.0) / static_cast<double>(samples);
        const double lower = uniform(engine, 0.0, 1.0) < 0.5 ? mean - limit : -1e9;
        for (double& r : rate) r = std::clamp(r, lower, mean + limit);
        const CleanFit fit = analysed(rate);
        return Faulty{limit, has(fit, findings::Kind::clipped), fit};
    });
    print_by_size(faulty, {1.5, 2.0, 2.5, 3.0, 3.5, 4.0});
}

}  // namespace

int main(int argc, char** argv) {
    std::string wanted;
    for (int i = 1; i < argc; ++i) {
        if (std::string(argv[i]) == "--quick") {
            records = 200;
        } else {
            wanted = argv[i];
        }
    }
    const std::vector<bench::Block> blocks = {{"clean", clean}, {"glitches", glitches}, {"jumps", jumps},
                                              {"wraps", wraps}, {"held", held},         {"clipped", clipped}};
    return bench::print_blocks("bench_allan_findings", wanted, blocks);
}
