#pragma once
#include <random>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"

namespace ringlock::test {

/// Files with bytes changed and parts cut off, doubled, emptied or lengthened, and the program on them.
class DamageTest : public ProgramTest {
   protected:
    /// One of many ways in which a byte can be wrong.
    static std::string with_other_bytes(const std::string& whole, std::mt19937_64& random);
    /// One of many ways in which the parts of a file can be wrong.
    static std::string with_other_parts(const std::string& whole, std::mt19937_64& random);

    /// A command on a damaged file.
    struct Attempt {
        Arguments arguments;
        std::string file;                 ///< the name that a refusal must have
        std::size_t bytes = 0;            ///< of the file
        std::string how;                  ///< was it damaged
        bool computes = false;            ///< what it does with a file that it reads takes time and memory of its own
        double memory_mb = 200.0 + 60.0;  ///< above the size of the file; 60 MB are for the program
        long processor_s = 5;             ///< for a refusal
    };
    /// Runs it and checks that the program says something about the file: that it ends by itself with one of its
    /// statuses, names the file where it refuses it, sends no commands to a terminal, takes no memory that the file
    /// does not explain, and, where it refuses, little time of the processor.
    Outcome expect_an_answer(const Attempt& attempt) const;

    /// A record of samples that the closed loop takes, short records of other kinds, and logs with a column x.
    void write_record(const std::string& name, int samples) const;
    void write_table(const std::string& name) const;
    void write_array(const std::string& name) const;
    void write_archive(const std::string& name) const;
    void write_matlab(const std::string& name) const;
};

}  // namespace ringlock::test
