#pragma once
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

/// What the programs that search readers for faults have in common.
///
/// Each input follows from the seed and its number alone, so that one that ends a reader can be made again by itself.
/// Inputs are read in processes that take thousands of them each: whatever ends such a process, a sanitizer, a signal
/// or a check of its own, is told with the number of the input, and the inputs behind it follow in another process.
namespace ringlock::fuzz {

class Chance {
   public:
    explicit Chance(std::uint64_t seed) : engine_(seed) {}
    /// A whole number from 0 to below - 1; 0 where `below` is 0.
    std::size_t any(std::size_t below) { return below == 0 ? 0 : static_cast<std::size_t>(engine_() % below); }
    bool one_in(std::size_t times) { return any(times) == 0; }
    template <class T>
    const T& of(const std::vector<T>& all) {
        return all[any(all.size())];
    }

   private:
    std::mt19937_64 engine_;
};

/// Bytes with so many faults: flipped bits, other bytes, numbers in place of lengths, parts cut out, doubled, emptied,
/// and an end that is missing.
std::string damaged(std::string bytes, std::size_t faults, Chance& chance);

/// The file that readers are given, in memory where the system has such a folder.
class InputFile {
   public:
    InputFile();
    InputFile(const InputFile&) = delete;
    InputFile& operator=(const InputFile&) = delete;
    ~InputFile();
    const std::string& path() const { return path_; }
    void write(std::string_view bytes);

   private:
    std::string path_;
    int descriptor_ = -1;
};

/// What readers made of the inputs.
struct Tally {
    std::uint64_t reads = 0;
    std::uint64_t read = 0;        ///< without complaint
    std::uint64_t refused = 0;     ///< with an InputError
    std::uint64_t guarded = 0;     ///< ended so that the guard, which is away here, says "is damaged": out of memory
    std::uint64_t of_library = 0;  ///< ended this process in the code of a library
};

/// Reads, and counts how it ended. Ends the process where a refusal is no InputError, does not name the file, or has
/// characters that a terminal takes for commands.
void attempt(const std::string& path, const std::function<void()>& read, Tally& tally);

/// A search of one kind of reader.
struct Search {
    std::string name;
    /// Writes one input and has it read.
    std::function<void(Chance& chance, InputFile& file, Tally& tally)> one;
    /// Libraries behind a guard (engine/store/guard.hpp), by parts of their file names: a fault in their code is
    /// counted only, for in the program it ends a process that is there for that.
    std::vector<std::string> guarded_libraries = {};
};

/// Runs `COUNT` inputs: the arguments are SEED COUNT, and FIRST, the number of the first one, which is 0 where it is
/// left out. The status is 0 where there was no fault, and something was read.
int run(const Search& search, const std::vector<std::string>& arguments);

}  // namespace ringlock::fuzz
