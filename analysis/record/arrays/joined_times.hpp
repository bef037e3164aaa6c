#pragma once
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "analysis/record/arrays/array_column.hpp"

namespace ringlock::record {

/// Time stamps as whole nanoseconds, from one column of whole seconds and one of the nanoseconds behind them, as logs
/// of ROS have them.
class JoinedTimes final : public ArrayColumn {
   public:
    /// Throws InputError where the columns differ in length.
    JoinedTimes(std::unique_ptr<ArrayColumn> seconds, std::unique_ptr<ArrayColumn> nanoseconds);

    std::uint64_t length() const override { return seconds_->length(); }
    Kind kind() const override { return Kind::whole; }
    std::string name() const override { return seconds_->name() + "," + nanoseconds_->name(); }
    std::string label() const override { return seconds_->label() + " and " + nanoseconds_->name(); }

    void read(std::uint64_t first, std::span<double> into) override;
    /// Throws InputError where a second or nanosecond is no whole number, a nanosecond is not in 0 to 999 999 999, or
    /// the second does not fit 64 bits in nanoseconds.
    void read(std::uint64_t first, std::span<std::int64_t> into) override;
    void read(std::uint64_t first, std::span<std::uint64_t> into) override;

   private:
    std::unique_ptr<ArrayColumn> seconds_;
    std::unique_ptr<ArrayColumn> nanoseconds_;
};

}  // namespace ringlock::record
