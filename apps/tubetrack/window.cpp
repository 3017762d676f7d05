// tubetrack_window TITLE: the window of `--view`, started by tubetrack. Pictures come on standard input, each as its
// width and height (32 bits each) and its pixels (blue, green, red); one byte on standard output says that the window
// is there. It ends when the input does, when q or Esc is pressed, or when the window is closed.
#include <poll.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/highgui.hpp>
#include <string>

#include "tubetrack/sensors/child_process.hpp"

namespace {

bool something_to_read() {
  pollfd waiting{STDIN_FILENO, POLLIN, 0};
  return poll(&waiting, 1, 0) > 0;
}

bool closed(const std::string& title) {
  constexpr int kEscape = 27;
  const int key = cv::waitKey(10) & 0xff;
  return key == 'q' || key == kEscape || cv::getWindowProperty(title, cv::WND_PROP_VISIBLE) < 1.0;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string title = argc > 1 ? argv[1] : "tubetrack";
  cv::namedWindow(title, cv::WINDOW_NORMAL | cv::WINDOW_KEEPRATIO | cv::WINDOW_GUI_NORMAL);
  if (write(STDOUT_FILENO, "w", 1) != 1) return 1;
  cv::Mat picture;
  while (!closed(title)) {
    if (!something_to_read()) continue;
    std::array<std::int32_t, 2> size{};
    if (!tubetrack::receive_from_parent(size.data(), sizeof size)) return 0;
    if (picture.cols != size[0] || picture.rows != size[1]) {
      picture.create(size[1], size[0], CV_8UC3);
      cv::resizeWindow(title, size[0], size[1]);
    }
    if (!tubetrack::receive_from_parent(picture.data, picture.total() * picture.elemSize())) return 0;
    cv::imshow(title, picture);
  }
  return 0;
}
