#include "line_ends.hpp"

#include <Eigen/Core>
#include <cmath>

namespace tubetrack {

void continue_from(Spline& spline, double t_begin, double t_end) {
  auto& q = spline.control_m;
  const auto at = [&](int i) -> Eigen::Vector3d& { return q[static_cast<std::size_t>(i)]; };
  const auto go_on = [&](int first, int step, int count) {
    for (int i = first; count > 0; i += step, --count) {
      const Eigen::Vector3d bend = ((at(i - step) - at(i - 2 * step)) - (at(i - 4 * step) - at(i - 5 * step))) / 3.0;
      at(i) = 2.0 * at(i - step) - at(i - 2 * step) + bend;
    }
  };
  // Control point i acts most at t = i − 1; replaced are those that do so half a span outside or more.
  const auto count = static_cast<int>(q.size());
  const int back = static_cast<int>(std::floor(t_end)) + 2;
  if (back >= 5 && back < count) go_on(back, 1, count - back);
  const int front = static_cast<int>(std::ceil(t_begin));
  if (front >= 0 && front + 5 < count) go_on(front, -1, front + 1);
}

}  // namespace tubetrack
