#include "analysis/record/arrays/npy_column.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

static_assert(std::endian::native == std::endian::little, "numbers are put together in the byte order of x86");

/// IEEE 754 binary16: 1 bit of sign, 5 of exponent, 10 of fraction.
double from_half(std::uint16_t bits) {
    const int exponent = (bits >> 10) & 0x1f;
    const int fraction = bits & 0x3ff;
    const double sign = (bits & 0x8000) != 0 ? -1.0 : 1.0;
    if (exponent == 0) return sign * std::ldexp(fraction, -24);
    if (exponent == 0x1f) {
        return fraction == 0 ? sign * std::numeric_limits<double>::infinity()
                             : std::numeric_limits<double>::quiet_NaN();
    }
    return sign * std::ldexp(1024 + fraction, exponent - 25);
}

template <class Stored, class T>
T as(const std::array<char, 8>& bytes) {
    Stored value;
    std::memcpy(&value, bytes.data(), sizeof value);
    return static_cast<T>(value);
}

/// One number of the array. Kinds that T cannot represent are not requested.
template <class T>
T number_at(const char* at, const NpyType& type) {
    std::array<char, 8> bytes{};
    std::memcpy(bytes.data(), at, type.bytes);
    if (type.big_endian) std::reverse(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(type.bytes));
    if (type.kind == 'f') {
        if (type.bytes == 2) return static_cast<T>(from_half(as<std::uint16_t, std::uint16_t>(bytes)));
        return type.bytes == 4 ? as<float, T>(bytes) : as<double, T>(bytes);
    }
    if (type.kind == 'i') {
        switch (type.bytes) {
            case 1:
                return as<std::int8_t, T>(bytes);
            case 2:
                return as<std::int16_t, T>(bytes);
            case 4:
                return as<std::int32_t, T>(bytes);
            default:
                return as<std::int64_t, T>(bytes);
        }
    }
    return as<std::uint64_t, T>(bytes);  // shorter types have been filled up with zeros
}

const NpyField& field_of(const NpyHeader& head, const Slice& slice) {
    if (slice.of.field.empty()) return head.fields.front();
    return *std::find_if(head.fields.begin(), head.fields.end(),
                         [&](const NpyField& field) { return field.name == slice.of.field.front(); });
}

class NpyColumn final : public ArrayColumn {
   public:
    NpyColumn(const std::string& file, const Slice& slice, const NpyHeader& head, std::unique_ptr<ByteSource> source)
        : file_(file), slice_(slice), type_(field_of(head, slice).type), source_(std::move(source)) {
        const std::vector<std::uint64_t>& sides = slice.of.sides;
        const std::uint64_t element = head.element_bytes;
        begin_ = head.bytes + field_of(head, slice).offset;
        length_ = sides[0];
        step_bytes_ = element;
        if (slice.of.field_is_array) {
            begin_ += slice.at * type_.bytes;
        } else if (sides.size() == 2) {
            // Elements between one place along a dimension and the next.
            const std::array<std::uint64_t, 2> steps = head.column_by_column
                                                           ? std::array<std::uint64_t, 2>{1, sides[0]}
                                                           : std::array<std::uint64_t, 2>{sides[1], 1};
            const auto along = static_cast<std::size_t>(slice.along);
            length_ = sides[along];
            step_bytes_ = steps[along] * element;
            begin_ += slice.at * steps[1 - along] * element;
        }
    }

    std::uint64_t length() const override { return length_; }
    Kind kind() const override {
        if (type_.kind == 'f') return Kind::real;
        return type_.kind == 'i' ? Kind::whole : Kind::whole_unsigned;
    }
    std::string name() const override { return slice_.name(); }
    std::string label() const override {
        return fmt::format("{}: dataset {}", printable(file_), printable(slice_.name()));
    }
    void read(std::uint64_t first, std::span<double> into) override { read_numbers(first, into); }
    void read(std::uint64_t first, std::span<std::int64_t> into) override { read_numbers(first, into); }
    void read(std::uint64_t first, std::span<std::uint64_t> into) override { read_numbers(first, into); }

   private:
    template <class T>
    void read_numbers(std::uint64_t first, std::span<T> into) {
        constexpr std::uint64_t at_once_bytes = 1 << 20;
        const auto block = static_cast<std::size_t>(std::max<std::uint64_t>(1, at_once_bytes / step_bytes_));
        for (std::size_t done = 0; done < into.size(); done += block) {
            const std::size_t now = std::min(block, into.size() - done);
            buffer_.resize((now - 1) * step_bytes_ + type_.bytes);
            if (!source_->read(begin_ + (first + done) * step_bytes_, buffer_)) {
                throw InputError(fmt::format("{}: cannot be read; the file is cut off or damaged",
                                             place(static_cast<std::size_t>(first) + done)));
            }
            for (std::size_t i = 0; i < now; ++i) into[done + i] = number_at<T>(&buffer_[i * step_bytes_], type_);
        }
    }

    std::string file_;
    Slice slice_;
    NpyType type_;
    std::unique_ptr<ByteSource> source_;
    std::uint64_t begin_ = 0;  // of the first number, in the bytes of the source
    std::uint64_t step_bytes_ = 0;
    std::uint64_t length_ = 0;
    std::vector<char> buffer_;
};

}  // namespace

void add_array(const NpyHeader& head, const std::string& file, const std::string& name,
               std::optional<std::uint64_t> bytes, Contents& contents) {
    double needed = static_cast<double>(head.bytes);
    double values = static_cast<double>(head.element_bytes);
    for (const std::uint64_t side : head.shape) values *= static_cast<double>(side);
    needed += values;
    if (bytes && needed > static_cast<double>(*bytes)) {
        throw InputError(fmt::format(
            "{}: dataset {}: says that its values take {:.15g} bytes, and there are {}: it is cut off or damaged",
            printable(file), printable(name), values, *bytes - std::min<std::uint64_t>(*bytes, head.bytes)));
    }
    for (const NpyField& field : head.fields) {
        Dataset dataset{name, head.shape, name};
        if (!field.name.empty()) {
            dataset.path += fmt::format("/{}", field.name);
            dataset.field.push_back(field.name);
        }
        if (field.count > 0) {
            dataset.field_is_array = true;
            dataset.sides.push_back(field.count);
        }
        std::string why = field.why_not;
        const auto is_same = [&](const NpyField& other) { return other.name == field.name; };
        if (std::count_if(head.fields.begin(), head.fields.end(), is_same) > 1) {
            why = "is the name of several fields; rename them";
        }
        if (field.name.empty() && head.fields.size() > 1) why = "has a field without a name; name it";
        if (why.empty() && (head.shape.empty() || head.shape.size() > 2)) {
            why = head.shape.empty() ? "is a single value; a series has many"
                                     : fmt::format("has {} dimensions; write one or two of them", head.shape.size());
        }
        if (why.empty() && !field.name.empty() && head.shape.size() != 1) {
            why = "is a field of a table of two dimensions; write the records as an array of one dimension";
        }
        if (why.empty()) {
            contents.datasets.push_back(std::move(dataset));
        } else {
            contents.others.push_back({dataset.path, why});
        }
    }
}

std::unique_ptr<ArrayColumn> npy_column(const std::string& file, const Slice& slice, const NpyHeader& head,
                                        std::unique_ptr<ByteSource> source) {
    return std::make_unique<NpyColumn>(file, slice, head, std::move(source));
}

}  // namespace ringlock::record
