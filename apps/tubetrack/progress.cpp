#include "progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace tubetrack {

Progress::Progress(bool quiet, std::optional<std::int64_t> total)
    : shown_(!quiet && isatty(STDERR_FILENO) != 0), total_(total) {}

void Progress::show(std::int64_t frames, const std::string& more) {
  const auto now = std::chrono::steady_clock::now();
  if (!shown_ || now - last_ < std::chrono::milliseconds(100)) return;
  last_ = now;
  std::string text = fmt::format("frame {}", frames);
  if (total_ && *total_ > 0) {
    constexpr std::int64_t kWidth = 30;
    const auto done = static_cast<std::size_t>(std::min(kWidth, kWidth * frames / *total_));
    text = fmt::format("[{}{}] {}/{}", std::string(done, '#'), std::string(kWidth - done, ' '), frames, *total_);
  }
  fmt::print(stderr, "\r\x1b[K{}  {}", text, more);
  std::fflush(stderr);
  drawn_ = true;
}

void Progress::clear() {
  if (std::exchange(drawn_, false)) fmt::print(stderr, "\r\x1b[K");
}

}  // namespace tubetrack
