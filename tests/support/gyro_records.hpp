#pragma once
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "engine/ensemble/ensemble.hpp"
#include "engine/ensemble/output_counts.hpp"

namespace ringlock::test {

/// One gyro through all arms of a study, kept whole.
struct GyroRecord {
    gyro::Setup setup;
    std::vector<std::vector<std::int64_t>> counts;  ///< [arm][minimum]
    int seen = 0;                                   ///< times that it was simulated

    double angle_arcsec(std::size_t arm, std::size_t minimum) const {
        return static_cast<double>(counts[arm][minimum]) * setup.scale_factor_arcsec / ensemble::counts_per_fringe;
    }
};

/// Keeps what gyros [first, last) of a scenario do; more may be added by later runs.
class GyroRecords {
   public:
    GyroRecords(scenario::Scenario scenario, std::size_t gyros) : scenario_(std::move(scenario)), records_(gyros) {
        for (GyroRecord& record : records_) record.counts.resize(scenario_.arms.size());
    }

    void run(std::int64_t first, std::int64_t last, int threads) {
        const auto make_sink = [this](std::int64_t gyro, std::size_t gyros) {
            return std::make_unique<Sink>(*this, gyro, gyros);
        };
        const ensemble::Job job{&scenario_, scenario_.arms, first, last, make_sink};
        ensemble::run({&job, 1}, threads, {});
    }
    const GyroRecord& operator[](std::int64_t gyro) const { return records_[static_cast<std::size_t>(gyro)]; }

   private:
    struct Sink final : ensemble::BlockSink {
        Sink(GyroRecords& owner, std::int64_t first_gyro, std::size_t count)
            : to(owner), first(static_cast<std::size_t>(first_gyro)), gyros(count) {}
        void angles(std::size_t arm, std::span<const simd::LaneCounts> counts) override {
            for (const simd::LaneCounts& row : counts) {
                for (std::size_t lane = 0; lane < gyros; ++lane) {
                    to.records_[first + lane].counts[arm].push_back(row[lane]);
                }
            }
        }
        void finish(const ensemble::BlockResult& result) override {
            const std::lock_guard lock(to.mutex_);
            for (std::size_t lane = 0; lane < gyros; ++lane) {
                to.records_[first + lane].setup = result.setups[lane];
                ++to.records_[first + lane].seen;
            }
        }
        GyroRecords& to;
        std::size_t first;
        std::size_t gyros;
    };

    scenario::Scenario scenario_;
    std::vector<GyroRecord> records_;
    std::mutex mutex_;
};

/// Gyro `gyro` of the scenario, by itself.
inline GyroRecord simulate(const scenario::Scenario& scenario, std::int64_t gyro) {
    GyroRecords records(scenario, static_cast<std::size_t>(gyro) + 1);
    records.run(gyro, gyro + 1, 1);
    return records[gyro];
}

}  // namespace ringlock::test
