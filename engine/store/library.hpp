#pragma once
#include <hdf5.h>
#include <sys/types.h>

#include <cstdint>
#include <mutex>
#include <string>
#include <type_traits>

#include "engine/store/hdf5.hpp"

/// For the sources of this room: HDF5 behind one lock, its complaints turned into exceptions.
namespace ringlock::store::detail {

static_assert(std::is_same_v<hid_t, std::int64_t>, "Id holds an hid_t without naming HDF5");

/// Held during every use of HDF5. Keeps the library from printing its errors and clears those of earlier calls.
class Lock {
   public:
    Lock();

   private:
    std::lock_guard<std::recursive_mutex> lock_;
};

/// fork() while no thread uses the library, which the child can then use.
pid_t fork_with_library();

/// The last error message of the library or of the operating system, shortened.
std::string last_error();

/// "FILE: WHERE: PROBLEM" as the error of wrong input.
[[noreturn]] void fail_input(const std::string& file, const std::string& where, const std::string& problem);
/// The same as the error of a failed run, with last_error() added.
[[noreturn]] void fail_run(const std::string& file, const std::string& where, const std::string& problem);

/// HDF5's type in memory and in the file.
template <Element T>
struct Type;
template <>
struct Type<double> {
    static hid_t memory() { return H5T_NATIVE_DOUBLE; }
    static hid_t stored() { return H5T_IEEE_F64LE; }
};
template <>
struct Type<std::int64_t> {
    static hid_t memory() { return H5T_NATIVE_INT64; }
    static hid_t stored() { return H5T_STD_I64LE; }
};
template <>
struct Type<std::uint64_t> {
    static hid_t memory() { return H5T_NATIVE_UINT64; }
    static hid_t stored() { return H5T_STD_U64LE; }
};
template <>
struct Type<std::int8_t> {
    static hid_t memory() { return H5T_NATIVE_INT8; }
    static hid_t stored() { return H5T_STD_I8LE; }
};

/// A new UTF-8 string type of variable length.
Id string_type();

}  // namespace ringlock::store::detail
