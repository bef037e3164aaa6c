#pragma once
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "tests/closure/suite/suite.hpp"

/// The tables of the benches of the closed loop.
namespace ringlock::test::closure {

/// What the command line of a bench says.
struct Command {
    std::string folder;
    double share = 1.0;                ///< of the records
    std::string only;                  ///< one kind of them, by name
    std::string seed;                  ///< the one record of that seed
    std::uint64_t series = 0;          ///< each has records of its own
    std::vector<std::string> effects;  ///< of the library that are drawn; none: all
    std::vector<std::string> without;  ///< of the library that are not drawn
    double multiple = 0.0;             ///< of the detection limit; 0: all
    std::optional<gyro::Setup> gyro;   ///< in place of the paper's device
    /// Length of all records [s], rate of samples [Hz], and dithers of 110 to 600 Hz; none: those of the bench.
    std::optional<double> length_s, rate_hz;
    bool direct = false;  ///< all records by the integration of the equation of motion

    bool wants(Kind kind) const { return only.empty() || only == name_of(kind); }
    bool wants(double of_limit) const { return multiple == 0.0 || multiple == of_limit; }
    /// The effects that are drawn.
    std::vector<std::string> kept(std::vector<std::string> names) const;
    std::size_t scaled(double count) const;
    /// One of so many is made, where it is one of `of` in the whole bench.
    std::size_t every(double of) const;
};
/// Makes the folder. Ends the program with status 2 where the command line is wrong.
Command command_of(int argc, char** argv, const char* program);

/// What was in a record, and how it was made.
struct TableRow {
    Kind kind = Kind::null;
    std::string truth;
    double multiple = 0.0;
    std::string condition, by;
    std::uint64_t seed = 0;
    std::string values;
    std::string expected;  ///< where, of what the library does not have
};
/// "k of n, share (95 % interval)", Clopper and Pearson.
std::string share_of(std::size_t count, std::size_t of);
/// "upper 95 % limit", one-sided, of the same kind.
std::string limit_of(std::size_t count, std::size_t of);

std::string values_of(const std::vector<Added>& truth);

using Outcomes = std::vector<std::optional<Outcome>>;

/// Everything that a bench leaves in its folder. Many threads may fill it.
class Tables {
   public:
    /// `unit` is that of the errors.
    Tables(std::string folder, std::size_t records, const char* unit, const char* record_length);
    /// What came of record k. All that is known is written now and then, so that a bench that is stopped leaves that.
    void keep(std::size_t k, TableRow truth, Outcome outcome);
    /// That a record is done with, which leaves nothing where an error has gone before.
    void count();
    void write() const;

   private:
    std::string folder_;
    const char* unit_;
    const char* record_length_;
    std::vector<TableRow> truths_;
    Outcomes outcomes_;
    std::size_t done_ = 0;
    std::mutex filling_;
};

}  // namespace ringlock::test::closure
