// How fast the Allan family is, beside a plain loop, NumPy and reading the record; side by side in one run.
// `bench_allan_speed [--points N]` prints a page; 10^7 points unless told. `bench_allan_speed totals` prints that of
// the totals of pieces.
#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/running_deviation.hpp"
#include "analysis/allan/sums/difference_sums.hpp"
#include "analysis/allan/sums/piece_sums.hpp"
#include "engine/random/stream.hpp"
#include "tests/bench/page.hpp"
#include "tests/bench/plain_allan.hpp"

namespace {

using namespace ringlock;
using allan::Estimator;

constexpr int rounds = 7;

double median(std::vector<double> v) {
    std::sort(v.begin(), v.end());
    return v[v.size() / 2];
}

double seconds_of(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// One way to do the work; what it comes to is kept, so that no compiler leaves it out.
struct Contender {
    std::string name;
    std::function<double()> work;
    std::vector<double> seconds = {};
};

volatile double kept = 0.0;

/// Contenders take turns.
void race(std::vector<Contender>& contenders) {
    for (Contender& c : contenders) kept = c.work();
    for (int round = 0; round < rounds; ++round) {
        for (Contender& c : contenders) c.seconds.push_back(seconds_of([&] { kept = c.work(); }));
    }
}

/// Times of one contender over those of another, round by round.
double ratio(const Contender& a, const Contender& b) {
    std::vector<double> r;
    for (std::size_t i = 0; i < a.seconds.size(); ++i) r.push_back(a.seconds[i] / b.seconds[i]);
    return median(r);
}

std::vector<double> random_walk(std::size_t points) {
    random::NormalStream normal({1, 0}, random::Purpose::noise_injection);
    std::vector<double> x(points);
    double sum = 0.0;
    for (double& v : x) v = sum += normal();
    return x;
}

/// Seconds of each round as the script prints them, and which library it was; empty where there is no NumPy.
std::vector<double> python_seconds(std::size_t points, std::string& library) {
    const std::string command =
        fmt::format("/usr/bin/python3 {}/tests/bench/allan_python.py {} 3 2>/dev/null", RINGLOCK_SOURCE_DIR, points);
    std::vector<double> out;
    FILE* pipe = popen(command.c_str(), "r");
    if (pipe == nullptr) return out;
    char line[256];
    while (std::fgets(line, sizeof line, pipe) != nullptr) {
        if (library.empty()) {
            library = std::string(line, std::strcspn(line, "\n"));
        } else {
            out.push_back(std::strtod(line, nullptr));
        }
    }
    pclose(pipe);
    return out;
}

double total(const std::vector<allan::SquareMean>& sums) {
    return std::accumulate(sums.begin(), sums.end(), 0.0,
                           [](double t, const allan::SquareMean& s) { return t + s.sum; });
}

/// The record in a file, bytes and nothing else, which the system has in its memory.
class RecordFile {
   public:
    explicit RecordFile(const std::vector<double>& x) : file_(std::tmpfile()), points_(x.size()) {
        if (file_ == nullptr || std::fwrite(x.data(), sizeof(double), x.size(), file_) != x.size()) std::abort();
    }
    RecordFile(const RecordFile&) = delete;
    RecordFile& operator=(const RecordFile&) = delete;
    ~RecordFile() { std::fclose(file_); }

    double read() {
        std::rewind(file_);
        buffer_.resize(points_);
        if (std::fread(buffer_.data(), sizeof(double), points_, file_) != points_) std::abort();
        return buffer_.back();
    }

   private:
    std::FILE* file_;
    std::size_t points_;
    std::vector<double> buffer_;
};

void octaves(const std::vector<double>& x) {
    RecordFile file(x);
    const auto factors =
        allan::octave_factors(allan::largest_factor(Estimator::oadev, static_cast<std::int64_t>(x.size())));
    const std::vector<std::size_t> m(factors.begin(), factors.end());
    const auto sums = [&] { return total(allan::sums_of_differences(x, {.order = 2}, m)); };
    std::vector<Contender> all = {
        {"the record read twice, one thread",
         [&] { return bench::read_all(x.data(), x.size()) + bench::read_all(x.data(), x.size()); }},
        {"a file of it read twice, one thread", [&] { return file.read() + file.read(); }},
        {"sums of oadev, all threads", sums},
        {"sums of oadev, one thread",
         [&] {
             const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
             return sums();
         }},
        {"a plain loop for each factor, one thread",
         [&] {
             double sum = 0.0;
             for (const std::size_t step : m) sum += bench::plain_sum_of_squares(x.data(), x.size(), step);
             return sum;
         }},
        {"oadev with noise and intervals", [&] { return allan::deviation(Estimator::oadev, x, 1.0, factors)[0].dev; }},
        {"ohdev with noise and intervals",
         [&] {
             const auto fewer =
                 allan::octave_factors(allan::largest_factor(Estimator::ohdev, static_cast<std::int64_t>(x.size())));
             return allan::deviation(Estimator::ohdev, x, 1.0, fewer)[0].dev;
         }},
        {"mdev with noise and intervals",
         [&] {
             const auto fewer =
                 allan::octave_factors(allan::largest_factor(Estimator::mdev, static_cast<std::int64_t>(x.size())));
             return allan::deviation(Estimator::mdev, x, 1.0, fewer)[0].dev;
         }},
        {"totdev with noise and intervals",
         [&] { return allan::deviation(Estimator::totdev, x, 1.0, factors)[0].dev; }},
        {"mtie", [&] { return allan::deviation(Estimator::mtie, x, 1.0, factors)[0].dev; }},
    };
    race(all);
    std::string library;
    const std::vector<double> python = python_seconds(x.size(), library);

    fmt::print("\n{} points, {} octaves, medians of {} rounds.\n\n", x.size(), m.size(), rounds);
    bench::head({"work", "ms", "ns a point and factor", "over sums of oadev"});
    for (const Contender& c : all) {
        const double s = median(c.seconds);
        bench::row({c.name, fmt::format("{:.1f}", 1e3 * s),
                    fmt::format("{:.3f}", 1e9 * s / static_cast<double>(x.size() * m.size())),
                    fmt::format("{:.2f}", ratio(c, all[2]))});
    }
    if (python.empty()) {
        fmt::print("\nNo NumPy here to be compared with (Debian: python3-numpy).\n");
        return;
    }
    const double s = median(python);
    bench::row({library + ", oadev without intervals", fmt::format("{:.1f}", 1e3 * s),
                fmt::format("{:.3f}", 1e9 * s / static_cast<double>(x.size() * m.size())),
                fmt::format("{:.1f}", s / median(all[2].seconds))});
    fmt::print("\n");
    bench::head({"figure", "wanted", "reached"});
    const auto figure = [&](const std::string& what, const char* wanted, double reached) {
        bench::row({what, wanted, fmt::format("{:.2f}", reached)});
    };
    figure("sums of oadev over the record read twice from memory", "<= 1", ratio(all[2], all[0]));
    figure("sums of oadev over the record read twice from a file", "<= 1", ratio(all[2], all[1]));
    figure("plain loop over sums of oadev, one thread each", ">= 1.5", ratio(all[4], all[3]));
    figure(library + " over oadev with noise and intervals", ">= 20", s / median(all[5].seconds));
}

void streams(const std::vector<double>& x) {
    std::vector<double> steps(x.size() - 1);
    for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = x[i + 1] - x[i];
    const auto stream = [](allan::Kind kind, const std::vector<double>& data) {
        allan::RunningDeviation running(kind, 1.0);
        for (std::size_t i = 0; i < data.size(); i += 4096) {
            running.add(std::span(data).subspan(i, std::min<std::size_t>(4096, data.size() - i)));
        }
        return running.points()[0].dev;
    };
    std::vector<Contender> all = {
        {"phase", [&] { return stream(allan::Kind::phase, x); }},
        {"increments", [&] { return stream(allan::Kind::increment, steps); }},
    };
    race(all);
    fmt::print("\nStreams, one thread, all octaves (wanted: 10 ns).\n\n");
    bench::head({"samples", "ns a sample"});
    for (const Contender& c : all) {
        bench::row({c.name, fmt::format("{:.2f}", 1e9 * median(c.seconds) / static_cast<double>(x.size()))});
    }
}

/// Every factor, each in time proportional to the record.
void all_factors(const std::vector<double>& x) {
    fmt::print("\nEvery factor of shorter records, the second time in a process, ns a point and factor.\n\n");
    bench::head({"points", "factors", "oadev", "mdev", "totdev"});
    for (const std::size_t n : {10'000U, 40'000U}) {
        const std::span<const double> part(x.data(), n);
        std::vector<std::string> cells = {std::to_string(n)};
        for (const Estimator e : {Estimator::oadev, Estimator::mdev, Estimator::totdev}) {
            const auto factors = allan::all_factors(allan::largest_factor(e, static_cast<std::int64_t>(n)));
            if (e == Estimator::oadev) cells.push_back(std::to_string(factors.size()));
            // Twice: distributions of few degrees of freedom are worked out once in a process.
            kept = allan::deviation(e, part, 1.0, factors)[0].dev;
            const double s = seconds_of([&] { kept = allan::deviation(e, part, 1.0, factors)[0].dev; });
            cells.push_back(fmt::format("{:.2f}", 1e9 * s / static_cast<double>(n * factors.size())));
        }
        bench::row(cells);
    }
}

/// Seconds of the quickest of some rounds: it has been disturbed least.
double quickest(int times, const std::function<double()>& work) {
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < times; ++i) least = std::min(least, seconds_of([&] { kept = work(); }));
    return least;
}

/// Octaves of the modified (of phase) and the Hadamard total (of rates), beside the sums piece by piece, which take so
/// long that they are made once and not of the longest record.
void octaves_of_totals(const std::vector<double>& x) {
    fmt::print("Octaves, all threads.\n\n");
    bench::head({"points", "deviation", "octaves", "sums, ms", "ns a point and factor", "sums piece by piece, ms",
                 "piece by piece over sums", "with noise and intervals, ms"});
    for (const std::size_t n : {10'000U, 100'000U, 1'000'000U}) {
        const std::span<const double> phase(x.data(), n);
        std::vector<double> steps;
        for (std::size_t i = 0; i + 1 < n; ++i) steps.push_back(x[i + 1] - x[i]);
        for (const Estimator e : {Estimator::mtotdev, Estimator::htotdev}) {
            const std::span<const double> samples = e == Estimator::mtotdev ? phase : std::span<const double>(steps);
            const auto factors = allan::octave_factors(allan::largest_factor(e, static_cast<std::int64_t>(n)));
            const auto sum_with = [&](allan::SquareMean (*sum)(std::span<const double>, std::size_t)) {
                double all = 0.0;
                for (const std::int64_t m : factors) all += sum(samples, static_cast<std::size_t>(m)).sum;
                return all;
            };
            const double together = quickest(3, [&] { return sum_with(allan::sum_of_pieces); });
            const double one_by_one =
                n <= 100'000 ? quickest(1, [&] { return sum_with(allan::sum_of_single_pieces); }) : 0.0;
            const double whole = quickest(3, [&] { return allan::deviation(e, phase, 1.0, factors)[0].dev; });
            bench::row({std::to_string(n), std::string(allan::name(e)), std::to_string(factors.size()),
                        fmt::format("{:.1f}", 1e3 * together),
                        fmt::format("{:.1f}", 1e9 * together / static_cast<double>(n * factors.size())),
                        one_by_one > 0.0 ? fmt::format("{:.0f}", 1e3 * one_by_one) : "",
                        one_by_one > 0.0 ? fmt::format("{:.0f}", one_by_one / together) : "",
                        fmt::format("{:.1f}", 1e3 * whole)});
        }
    }
}

void every_factor_of_totals(const std::vector<double>& x) {
    fmt::print("\nEvery factor, with noise and intervals, the second time in a process.\n\n");
    bench::head({"points", "factors", "mtotdev, s", "htotdev, s"});
    for (const std::size_t n : {2'000U, 20'000U}) {
        const std::span<const double> part(x.data(), n);
        std::vector<std::string> cells = {std::to_string(n)};
        for (const Estimator e : {Estimator::mtotdev, Estimator::htotdev}) {
            const auto factors = allan::all_factors(allan::largest_factor(e, static_cast<std::int64_t>(n)));
            if (e == Estimator::mtotdev) cells.push_back(std::to_string(factors.size()));
            kept = allan::deviation(e, part, 1.0, factors)[0].dev;
            cells.push_back(
                fmt::format("{:.2f}", quickest(1, [&] { return allan::deviation(e, part, 1.0, factors)[0].dev; })));
        }
        bench::row(cells);
    }
}

}  // namespace

int main(int argc, char** argv) {
    std::size_t points = 10'000'000;
    if (argc == 2 && std::strcmp(argv[1], "totals") == 0) {
        const std::vector<double> x = random_walk(1'000'000);
        octaves_of_totals(x);
        every_factor_of_totals(x);
        return 0;
    }
    if (argc == 3 && std::strcmp(argv[1], "--points") == 0) points = std::stoul(argv[2]);
    const std::vector<double> x = random_walk(points);
    octaves(x);
    streams(x);
    all_factors(x);
}
