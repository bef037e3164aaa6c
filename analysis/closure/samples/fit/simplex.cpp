#include "analysis/closure/samples/fit/simplex.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

namespace ringlock::closure {

Point smallest(const ValuesAt& f, const Point& start, double size, int steps) {
    const std::size_t n = start.size();
    std::vector<Point> points(n + 1, start);
    for (std::size_t i = 0; i < n; ++i) points[i + 1][i] += size;
    std::vector<double> values = f(points);
    std::vector<std::pair<double, Point>> corners;
    for (std::size_t c = 0; c <= n; ++c) corners.emplace_back(values[c], points[c]);
    const auto lower = [](const auto& a, const auto& b) { return a.first < b.first; };
    for (; steps > 0; --steps) {
        std::sort(corners.begin(), corners.end(), lower);
        const double best = corners.front().first;
        auto& worst = corners.back();
        if (worst.first - best < 0.01) break;
        Point centre(n, 0.0);
        for (std::size_t c = 0; c < n; ++c) {
            for (std::size_t i = 0; i < n; ++i) centre[i] += corners[c].second[i] / static_cast<double>(n);
        }
        points.assign(4, centre);
        constexpr double reflected = -1.0;
        constexpr double expanded = -2.0;
        constexpr double outside = -0.5;
        constexpr double inside = 0.5;
        const double along[] = {reflected, expanded, outside, inside};
        for (std::size_t k = 0; k < points.size(); ++k) {
            for (std::size_t i = 0; i < n; ++i) points[k][i] += along[k] * (worst.second[i] - centre[i]);
        }
        values = f(points);
        std::size_t taken = 0;
        if (values[0] < best) {
            taken = values[1] < values[0] ? 1 : 0;
        } else if (!(values[0] < corners[n - 1].first)) {
            taken = values[0] < worst.first ? 2 : 3;
            if (!(values[taken] < std::min(values[0], worst.first))) {
                points.clear();
                for (std::size_t c = 1; c <= n; ++c) {
                    Point& place = points.emplace_back(corners[c].second);
                    for (std::size_t i = 0; i < n; ++i) place[i] = 0.5 * (place[i] + corners.front().second[i]);
                }
                values = f(points);
                for (std::size_t c = 1; c <= n; ++c) corners[c] = {values[c - 1], points[c - 1]};
                continue;
            }
        }
        worst = {values[taken], points[taken]};
    }
    return std::min_element(corners.begin(), corners.end(), lower)->second;
}

}  // namespace ringlock::closure
