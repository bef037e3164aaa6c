#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "engine/core/error.hpp"

/// Values as bytes and back. A function each(archive, value), found by the type of the value, visits the members of a
/// structure in the order in which they are stored, so that writing and reading cannot differ.
namespace ringlock::parts {

template <class T>
concept Plain = std::is_arithmetic_v<T>;

/// Turns values into bytes.
class Packer {
   public:
    template <Plain T>
    void operator()(const T& value) {
        const auto* bytes = reinterpret_cast<const std::byte*>(&value);
        bytes_.insert(bytes_.end(), bytes, bytes + sizeof value);
    }
    void operator()(const std::string& text) {
        (*this)(static_cast<std::uint64_t>(text.size()));
        for (const char c : text) (*this)(c);
    }
    template <class T>
    void operator()(const std::optional<T>& value) {
        (*this)(value.has_value());
        if (value) (*this)(*value);
    }
    template <class T>
    void operator()(const std::vector<T>& values) {
        (*this)(static_cast<std::uint64_t>(values.size()));
        if constexpr (Plain<T>) {
            const auto bytes = std::as_bytes(std::span(values));
            bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
        } else {
            for (const T& value : values) (*this)(value);
        }
    }
    template <class T>
    requires std::is_class_v<T>
    void operator()(const T& value) { each(*this, value); }

    std::span<const std::byte> bytes() const { return bytes_; }
    std::vector<std::byte> take() { return std::move(bytes_); }

   private:
    std::vector<std::byte> bytes_;
};

/// Turns bytes into values. Throws InputError where they end too early.
class Unpacker {
   public:
    explicit Unpacker(std::span<const std::byte> bytes) : rest_(bytes) {}

    template <Plain T>
    void operator()(T& value) {
        const auto bytes = next(sizeof value);
        if constexpr (std::is_same_v<T, bool>) {
            value = bytes.front() != std::byte{0};
        } else {
            std::memcpy(&value, bytes.data(), sizeof value);
        }
    }
    void operator()(std::string& text) {
        const auto bytes = next(count(1));
        text.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }
    template <class T>
    void operator()(std::optional<T>& value) {
        bool has = false;
        (*this)(has);
        if (has) {
            (*this)(value.emplace());
        } else {
            value.reset();
        }
    }
    template <class T>
    void operator()(std::vector<T>& values) {
        if constexpr (Plain<T>) {
            values.resize(count(sizeof(T)));
            const auto bytes = next(values.size() * sizeof(T));
            if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
        } else {
            values.resize(count(1));
            for (T& value : values) (*this)(value);
        }
    }
    template <class T>
    requires std::is_class_v<T>
    void operator()(T& value) { each(*this, value); }

    bool at_end() const { return rest_.empty(); }

   private:
    /// A number of elements that can be there: each takes that many bytes at least.
    std::size_t count(std::size_t least_bytes) {
        std::uint64_t number = 0;
        (*this)(number);
        if (number > rest_.size() / least_bytes) throw InputError("a record of gyros ends too early");
        return static_cast<std::size_t>(number);
    }
    std::span<const std::byte> next(std::size_t bytes) {
        if (bytes > rest_.size()) throw InputError("a record of gyros ends too early");
        const auto taken = rest_.first(bytes);
        rest_ = rest_.subspan(bytes);
        return taken;
    }

    std::span<const std::byte> rest_;
};

}  // namespace ringlock::parts
