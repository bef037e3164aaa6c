#include "engine/store/contents.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

#include "engine/core/error.hpp"
#include "engine/store/library.hpp"

namespace ringlock::store {
namespace {

using detail::Lock;

/// Deeper than any file that people make, and shallow enough for the stack.
constexpr int deepest_group = 64;

ListedAttribute listed_attribute(const File& file, const Node& node, const std::string& name) {
    const Lock lock;
    const Id attribute(H5Aopen_by_name(file.library_id(), node.path().c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT));
    const Id type(H5Aget_type(attribute.get()));
    const Id space(H5Aget_space(attribute.get()));
    if (!attribute.valid() || !type.valid() || !space.valid())
        detail::fail_input(node.file(), fmt::format("attribute {} of {}", name, node.path()), "cannot be read");
    const H5T_class_t type_class = H5Tget_class(type.get());
    if (type_class == H5T_STRING) return {name, node.string_attribute(name)};
    if (H5Sget_simple_extent_npoints(space.get()) != 1) return {name, node.doubles_attribute(name)};
    if (type_class != H5T_INTEGER) return {name, node.double_attribute(name)};
    if (H5Tget_sign(type.get()) == H5T_SGN_NONE) return {name, node.uint_attribute(name)};
    return {name, node.int_attribute(name)};
}

std::vector<ListedAttribute> listed_attributes(const File& file, const Node& node, bool of_dataset) {
    std::vector<ListedAttribute> out;
    for (const std::string& name : node.attribute_names()) {
        if (of_dataset && (name == "unit" || name == "description")) continue;
        out.push_back(listed_attribute(file, node, name));
    }
    return out;
}

ElementKind kind_of(const Dataset& dataset) {
    if (dataset.holds<std::string>()) return ElementKind::text;
    if (dataset.holds<std::int8_t>()) return ElementKind::small_integer;
    if (dataset.holds<std::int64_t>()) return ElementKind::integer;
    if (dataset.holds<std::uint64_t>()) return ElementKind::unsigned_integer;
    if (dataset.holds<double>()) return ElementKind::real;
    detail::fail_input(dataset.file(), dataset.path(),
                       "holds neither numbers nor text, and cannot be read; is it written by another program?");
}

class ContentsWalk {
   public:
    explicit ContentsWalk(const File& file) : file_(file) {}

    std::vector<ListedObject> all() {
        add_group(file_, 0);
        return std::move(found_);
    }

   private:
    /// False where the object has been listed under another name.
    bool is_new(const std::string& path) {
        const Lock lock;
        H5O_info_t info;
        if (H5Oget_info_by_name2(file_.library_id(), path.c_str(), &info, H5O_INFO_BASIC, H5P_DEFAULT) < 0)
            detail::fail_input(file_.file(), path, "cannot be opened");
        return seen_.insert({info.fileno, info.addr}).second;
    }

    void add_group(const Group& group, int depth) {
        if (depth > deepest_group) {
            detail::fail_input(file_.file(), group.path(),
                               fmt::format("lies more than {} groups deep; is the file damaged?", deepest_group));
        }
        if (!is_new(group.path())) return;
        found_.push_back(ListedObject{group.path(), false, listed_attributes(file_, group, false)});
        for (const std::string& name : group.children()) {
            if (group.has_group(name)) {
                add_group(group.group(name), depth + 1);
            } else if (group.has_dataset(name)) {
                add_dataset(group.dataset(name));
            } else {
                detail::fail_input(file_.file(), group.path() == "/" ? "/" + name : group.path() + "/" + name,
                                   "is neither a group nor a dataset, or a link that leads nowhere");
            }
        }
    }

    void add_dataset(const Dataset& dataset) {
        if (!is_new(dataset.path())) return;
        found_.push_back(ListedObject{dataset.path(), true, listed_attributes(file_, dataset, true), dataset.shape(),
                                      kind_of(dataset), dataset.unit(), dataset.description()});
    }

    const File& file_;
    std::set<std::pair<unsigned long, haddr_t>> seen_;
    std::vector<ListedObject> found_;
};

template <class Read>
Values values_as(ElementKind kind, Read read) {
    switch (kind) {
        case ElementKind::text:
            return read(std::string());
        case ElementKind::integer:
            return read(std::int64_t{});
        case ElementKind::unsigned_integer:
            return read(std::uint64_t{});
        case ElementKind::small_integer:
            return read(std::int8_t{});
        case ElementKind::real:
            break;
    }
    return read(double{});
}

}  // namespace

std::uint64_t ListedObject::rows() const { return shape.empty() ? 1 : shape[0]; }
std::uint64_t ListedObject::columns() const { return shape.size() == 2 ? shape[1] : 1; }
std::uint64_t ListedObject::size() const { return rows() * columns(); }
std::string ListedObject::name() const { return path.substr(path.rfind('/') + 1); }

std::vector<ListedObject> contents_of(const File& file) { return ContentsWalk(file).all(); }

Values read_values(const File& file, const ListedObject& object, std::uint64_t first_row, std::uint64_t n_rows) {
    const Dataset dataset = file.dataset(object.path);
    return values_as(object.kind, [&]<class T>(T) -> Values { return dataset.read_rows<T>(first_row, n_rows); });
}

Values read_values(const File& file, const ListedObject& object) {
    const Dataset dataset = file.dataset(object.path);
    return values_as(object.kind, [&]<class T>(T) -> Values { return dataset.read<T>(); });
}

}  // namespace ringlock::store
