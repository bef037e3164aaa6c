#pragma once
#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "analysis/allan/sums/phase.hpp"
#include "engine/random/stream.hpp"

/// Records that lose samples, for the tests of what is estimated from the rest.
namespace ringlock::test {

/// A share of the samples, in pieces of so many.
struct Losses {
    double share = 0.0;
    std::size_t length = 1;
};

/// Puts NaN in the place of pieces at random, until the share is lost; not the first and the last sample.
inline void lose(const Losses& losses, std::uint64_t seed, std::vector<double>& data) {
    random::Engine engine = random::make_engine({seed, 77}, random::Purpose::missed_counts);
    const auto wanted = static_cast<std::size_t>(std::lround(losses.share * static_cast<double>(data.size())));
    boost::random::uniform_real_distribution<double> place(1.0, static_cast<double>(data.size() - 1 - losses.length));
    for (std::size_t lost = 0; lost < wanted;) {
        const auto begin = static_cast<std::size_t>(place(engine));
        for (std::size_t i = begin; i < begin + losses.length && lost < wanted; ++i) {
            lost += std::isnan(data[i]) ? 0 : 1;
            data[i] = std::numeric_limits<double>::quiet_NaN();
        }
    }
}

inline std::vector<double> rates_of_angle(const std::vector<double>& angle) {
    std::vector<double> rate;
    for (std::size_t i = 1; i < angle.size(); ++i) rate.push_back(angle[i] - angle[i - 1]);
    return rate;
}

/// What is known of the rates: a row for each rate that is there, or of phase for each difference from one angle that
/// is there to the next.
inline Eigen::MatrixXd seen_rates(const std::vector<double>& data, allan::Kind kind) {
    const bool phase = kind == allan::Kind::phase;
    const auto n = static_cast<Eigen::Index>(data.size() - (phase ? 1 : 0));
    std::vector<Eigen::RowVectorXd> rows;
    Eigen::Index begin = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
        if (std::isnan(data[static_cast<std::size_t>(i + (phase ? 1 : 0))])) {
            if (!phase) begin = i + 1;
            continue;
        }
        Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(n);
        row.segment(begin, i + 1 - begin).setOnes();
        rows.push_back(row);
        begin = i + 1;
    }
    Eigen::MatrixXd out(static_cast<Eigen::Index>(rows.size()), n);
    for (std::size_t k = 0; k < rows.size(); ++k) out.row(static_cast<Eigen::Index>(k)) = rows[k];
    return out;
}

}  // namespace ringlock::test
