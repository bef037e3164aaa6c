#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "engine/store/hdf5.hpp"
#include "engine/store/library.hpp"

namespace ringlock::store {
namespace {

using detail::Lock;

std::string where(const Node& node, const std::string& name) {
    return fmt::format("attribute {} of {}", name, node.path());
}

void write_attribute(const Node& node, hid_t object, const std::string& name, const Id& space, hid_t stored,
                     hid_t memory, const void* value) {
    if (H5Aexists(object, name.c_str()) > 0) H5Adelete(object, name.c_str());
    const Id attribute(H5Acreate2(object, name.c_str(), stored, space.get(), H5P_DEFAULT, H5P_DEFAULT));
    if (!attribute.valid() || H5Awrite(attribute.get(), memory, value) < 0)
        detail::fail_run(node.file(), where(node, name), "cannot be written");
}

template <class T>
void write_scalar(const Node& node, hid_t object, const std::string& name, T value) {
    const Lock lock;
    const Id space(H5Screate(H5S_SCALAR));
    write_attribute(node, object, name, space, detail::Type<T>::stored(), detail::Type<T>::memory(), &value);
}

/// An attribute opened for reading, with its type and number of elements.
struct Opened {
    Id attribute;
    Id type;
    H5T_class_t type_class = H5T_NO_CLASS;
    std::uint64_t size = 0;
};

Opened open_attribute(const Node& node, hid_t object, const std::string& name) {
    if (H5Aexists(object, name.c_str()) <= 0) detail::fail_input(node.file(), where(node, name), "missing");
    Opened opened;
    opened.attribute = Id(H5Aopen(object, name.c_str(), H5P_DEFAULT));
    opened.type = Id(H5Aget_type(opened.attribute.get()));
    opened.type_class = H5Tget_class(opened.type.get());
    const Id space(H5Aget_space(opened.attribute.get()));
    const hssize_t size = H5Sget_simple_extent_npoints(space.get());
    if (size < 0) detail::fail_input(node.file(), where(node, name), "cannot be read");
    opened.size = static_cast<std::uint64_t>(size);
    return opened;
}

/// Reads one number (a vector of one counts) in the requested type.
template <class T>
T read_scalar(const Node& node, const Opened& opened, const std::string& name) {
    T value{};
    if (H5Aread(opened.attribute.get(), detail::Type<T>::memory(), &value) < 0)
        detail::fail_input(node.file(), where(node, name), "cannot be read");
    return value;
}

void require(const Node& node, const Opened& opened, const std::string& name, bool type_is_right,
             std::string_view what) {
    if (!type_is_right || opened.size != 1)
        detail::fail_input(node.file(), where(node, name), fmt::format("must be {}", what));
}

template <std::integral T>
T read_integer(const Node& node, hid_t object, const std::string& name) {
    const Lock lock;
    const Opened opened = open_attribute(node, object, name);
    require(node, opened, name, opened.type_class == H5T_INTEGER, "an integer");
    const auto in_range = [&](auto value) {
        if (!std::in_range<T>(value))
            detail::fail_input(node.file(), where(node, name), fmt::format("{} is out of range", value));
        return static_cast<T>(value);
    };
    if (H5Tget_sign(opened.type.get()) == H5T_SGN_NONE) return in_range(read_scalar<std::uint64_t>(node, opened, name));
    return in_range(read_scalar<std::int64_t>(node, opened, name));
}

herr_t collect_name(hid_t /*object*/, const char* name, const H5A_info_t* /*info*/, void* names) {
    static_cast<std::vector<std::string>*>(names)->emplace_back(name);
    return 0;
}

bool is_number(const Opened& opened) { return opened.type_class == H5T_FLOAT || opened.type_class == H5T_INTEGER; }

}  // namespace

void Node::set_attribute(const std::string& name, std::string_view value) {
    const Lock lock;
    const Id space(H5Screate(H5S_SCALAR));
    const Id type = detail::string_type();
    const std::string terminated(value);
    const char* pointer = terminated.c_str();
    write_attribute(*this, id_.get(), name, space, type.get(), type.get(), &pointer);
}

void Node::set_attribute(const std::string& name, double value) { write_scalar(*this, id_.get(), name, value); }
void Node::set_signed(const std::string& name, std::int64_t value) { write_scalar(*this, id_.get(), name, value); }
void Node::set_unsigned(const std::string& name, std::uint64_t value) { write_scalar(*this, id_.get(), name, value); }

void Node::set_attribute(const std::string& name, const std::vector<double>& values) {
    const Lock lock;
    const hsize_t size = values.size();
    const Id space(values.empty() ? H5Screate(H5S_NULL) : H5Screate_simple(1, &size, nullptr));
    constexpr double nothing = 0.0;  // HDF5 requires an address even if there is nothing to write
    write_attribute(*this, id_.get(), name, space, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE,
                    values.empty() ? &nothing : values.data());
}

bool Node::has_attribute(const std::string& name) const {
    const Lock lock;
    return H5Aexists(id_.get(), name.c_str()) > 0;
}

std::vector<std::string> Node::attribute_names() const {
    const Lock lock;
    std::vector<std::string> names;
    if (H5Aiterate2(id_.get(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, collect_name, &names) < 0)
        detail::fail_input(file_, path_, "the attributes cannot be listed");
    std::ranges::sort(names);
    return names;
}

std::string Node::string_attribute(const std::string& name) const {
    const Lock lock;
    const Opened opened = open_attribute(*this, id_.get(), name);
    require(*this, opened, name, opened.type_class == H5T_STRING, "a string");
    if (H5Tis_variable_str(opened.type.get()) > 0) {
        const Id type(H5Tcopy(H5T_C_S1));
        H5Tset_size(type.get(), H5T_VARIABLE);
        H5Tset_cset(type.get(), H5Tget_cset(opened.type.get()));
        char* text = nullptr;
        if (H5Aread(opened.attribute.get(), type.get(), &text) < 0)
            detail::fail_input(file_, where(*this, name), "cannot be read");
        std::string value = text != nullptr ? text : "";
        H5free_memory(text);
        return value;
    }
    std::string value(H5Tget_size(opened.type.get()), '\0');
    if (H5Aread(opened.attribute.get(), opened.type.get(), value.data()) < 0)
        detail::fail_input(file_, where(*this, name), "cannot be read");
    value.resize(std::strlen(value.c_str()));
    return value;
}

double Node::double_attribute(const std::string& name) const {
    const Lock lock;
    const Opened opened = open_attribute(*this, id_.get(), name);
    require(*this, opened, name, is_number(opened), "a number");
    return read_scalar<double>(*this, opened, name);
}

std::int64_t Node::int_attribute(const std::string& name) const {
    return read_integer<std::int64_t>(*this, id_.get(), name);
}

std::uint64_t Node::uint_attribute(const std::string& name) const {
    return read_integer<std::uint64_t>(*this, id_.get(), name);
}

std::vector<double> Node::doubles_attribute(const std::string& name) const {
    const Lock lock;
    const Opened opened = open_attribute(*this, id_.get(), name);
    if (!is_number(opened)) detail::fail_input(file_, where(*this, name), "must be numbers");
    std::vector<double> values(opened.size);
    if (!values.empty() && H5Aread(opened.attribute.get(), H5T_NATIVE_DOUBLE, values.data()) < 0)
        detail::fail_input(file_, where(*this, name), "cannot be read");
    return values;
}

}  // namespace ringlock::store
