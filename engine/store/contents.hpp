#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "engine/store/hdf5.hpp"

/// Lists all that an HDF5 file holds, for programs that do not know its format.
namespace ringlock::store {

/// Types in which values are read, see Element. Other numbers are read into the smallest of them that holds all of
/// their values.
enum class ElementKind { text, real, integer, unsigned_integer, small_integer };

/// Value of an attribute; a number of several elements is a list.
using AttributeValue = std::variant<std::string, double, std::int64_t, std::uint64_t, std::vector<double>>;

struct ListedAttribute {
    std::string name;
    AttributeValue value;
};

/// A group or dataset.
struct ListedObject {
    std::string path;  ///< from the root, "/arms/ideal"; that of the root itself is "/"
    bool is_dataset = false;
    std::vector<ListedAttribute> attributes;  ///< by name; without unit and description of a dataset
    // Of datasets only:
    Shape shape = {};
    ElementKind kind = ElementKind::real;
    std::string unit = {};
    std::string description = {};

    std::uint64_t size() const;     ///< elements
    std::uint64_t rows() const;     ///< 1 of a scalar
    std::uint64_t columns() const;  ///< elements of a row
    std::string name() const;       ///< the last part of the path, empty for the root
};

/// Objects of the file in the order of their paths, each group before its members. An object that has several names is
/// listed once, under the first.
///
/// Throws InputError, naming file and object, where an object can be read neither as group nor as dataset of numbers or
/// text in at most two dimensions.
std::vector<ListedObject> contents_of(const File& file);

/// Values of a dataset, rows one after the other.
using Values = std::variant<std::vector<std::string>, std::vector<double>, std::vector<std::int64_t>,
                            std::vector<std::uint64_t>, std::vector<std::int8_t>>;

/// Rows [first_row, first_row + n_rows) of a listed dataset.
Values read_values(const File& file, const ListedObject& object, std::uint64_t first_row, std::uint64_t n_rows);
/// All of them.
Values read_values(const File& file, const ListedObject& object);

}  // namespace ringlock::store
