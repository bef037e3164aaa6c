#include "engine/ensemble/read_outputs.hpp"

#include <algorithm>

#include "engine/ensemble/output_counts.hpp"

namespace ringlock::ensemble {

ReadOutputs::ReadOutputs(const Schedule& schedule, std::size_t arms, std::size_t gyros)
    : warm_up_outputs_(schedule.warm_up_outputs), outputs_(schedule.outputs()), arms_(arms) {
    for (Arm& arm : arms_) arm.next.assign(gyros, 0);
}

void ReadOutputs::take(const GyroBlock& block) {
    for (std::size_t a = 0; a < arms_.size(); ++a) {
        Arm& arm = arms_[a];
        arm.rows.erase(arm.rows.begin(), arm.rows.begin() + static_cast<std::ptrdiff_t>(arm.ready));
        arm.first += static_cast<std::int64_t>(arm.ready);
        for (std::size_t gyro = 0; gyro < arm.next.size(); ++gyro) {
            take(block.reader(a, gyro), block.setups()[gyro].scale_factor_arcsec, gyro, arm);
        }
        arm.ready = static_cast<std::size_t>(*std::min_element(arm.next.begin(), arm.next.end()) - arm.first);
    }
}

void ReadOutputs::take(const reader::Reader& reader, double scale_factor_arcsec, std::size_t gyro, Arm& arm) const {
    std::int64_t number = reader.first_output() - warm_up_outputs_;
    for (const double angle_arcsec : reader.angles_arcsec()) {
        if (number >= 0 && number < outputs_) {
            const auto row = static_cast<std::size_t>(number - arm.first);
            if (row >= arm.rows.size()) arm.rows.resize(row + 1);
            arm.rows[row][gyro] = counts_of(angle_arcsec / scale_factor_arcsec);
            arm.next[gyro] = number + 1;
        }
        ++number;
    }
}

std::span<const simd::LaneCounts> ReadOutputs::rows(std::size_t arm) const {
    return std::span(arms_[arm].rows).first(arms_[arm].ready);
}

bool ReadOutputs::complete() const {
    return std::all_of(arms_.begin(), arms_.end(),
                       [&](const Arm& arm) { return *std::min_element(arm.next.begin(), arm.next.end()) == outputs_; });
}

}  // namespace ringlock::ensemble
