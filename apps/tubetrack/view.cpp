#include "view.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include "feed.hpp"
#include "tubetrack/report/overlay.hpp"

namespace tubetrack {

namespace {

constexpr const char* kProgram = "tubetrack_window";
constexpr std::chrono::seconds kWindowPatience{20};   ///< for the window to come up
constexpr std::chrono::milliseconds kInterval{33};    ///< between two pictures
constexpr std::chrono::milliseconds kLookAfter{100};  ///< whether the window was closed, while no result comes

}  // namespace

Expected<std::unique_ptr<View>> View::open(const std::string& title, const Intrinsics& intrinsics) {
  if (ChildProcess::beside_us(kProgram).empty()) {
    return tl::make_unexpected(Error::failed(
        "--view: this tubetrack was built without a window; install libopencv-highgui-dev and build again"));
  }
  auto window = ChildProcess::start(kProgram, {title});
  if (!window) return tl::make_unexpected(window.error());
  // It says one byte when the window is there.
  char byte = 0;
  if (window->ready(kWindowPatience) && window->receive(&byte, 1)) {
    return std::unique_ptr<View>(new View(std::move(*window), intrinsics));
  }
  const char* display = std::getenv("DISPLAY");
  return tl::make_unexpected(Error::failed(
      fmt::format("--view: the window can't be opened; DISPLAY is {}; run it on a desktop, or leave --view out",
                  display == nullptr ? "not set" : display)));
}

View::View(ChildProcess window, const Intrinsics& intrinsics)
    : window_(std::move(window)), intrinsics_(intrinsics), thread_([this] { draw_newest(); }) {}

View::~View() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    changed_.notify_all();
  }
  window_.hang_up();
  thread_.join();
}

void View::show(const DepthFrame& frame, const TubeFrame& result) {
  Shown shown{kept(frame), result};
  const std::lock_guard lock(mutex_);
  newest_ = std::move(shown);
  changed_.notify_all();
}

/// Empty where none came for a while, or the run is over.
std::optional<View::Shown> View::wait_for_newest() {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, kLookAfter, [this] { return stop_ || newest_; });
  return std::exchange(newest_, std::nullopt);
}

void View::draw_newest() {
  const auto over = [this] {
    const std::lock_guard lock(mutex_);
    return stop_;
  };
  auto next = std::chrono::steady_clock::now();
  while (!over()) {
    bool closed = window_.gone();
    if (const auto shown = wait_for_newest(); shown && !closed) {
      const Picture picture = draw_view(shown->frame, intrinsics_, shown->result);
      const std::array<std::int32_t, 2> size = {picture.width, picture.height};
      closed = !window_.send(size.data(), sizeof size) || !window_.send(picture.bgr.data(), picture.bgr.size());
      next = std::max(next + kInterval, std::chrono::steady_clock::now());
    }
    if (closed) {
      if (!over()) std::raise(SIGINT);
      return;
    }
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, next, [this] { return stop_; });
  }
}

}  // namespace tubetrack
