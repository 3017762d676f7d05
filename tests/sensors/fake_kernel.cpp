// The media controller and V4L2, as libcamera 0.0.3 asks them about a UVC camera.
#include "sensors/fake_kernel.hpp"

#include <fcntl.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>

namespace tubetrack::test {

namespace {

int fail(int code) {
  errno = code;
  return -1;
}

}  // namespace

FakeKernel::FakeKernel() {
  std::string name = (std::filesystem::temp_directory_path() / "fake_camera_XXXXXX").string();
  folder_ = mkdtemp(name.data());
  std::filesystem::create_directories(folder_ + "/firmware_node");
  std::filesystem::create_directories(folder_ + "/1-1/1-1:1.0");
  std::ofstream(folder_ + "/firmware_node/path") << "\\_SB_.FAKE\n";
  std::ofstream(folder_ + "/1-1/idVendor") << "1209\n";
  std::ofstream(folder_ + "/1-1/idProduct") << "0001\n";
  std::ofstream(folder_ + "/1-1/removable") << "removable\n";
  monitor_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK | EFD_SEMAPHORE);
  std::atexit([] { std::filesystem::remove_all(get().folder_); });
}

std::optional<int> FakeKernel::open_device(const char* path) {
  if (std::string_view(path) == kFakeMedia) return media_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (std::string_view(path) == kFakeVideo) return video_ = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK | EFD_SEMAPHORE);
  return {};
}

std::optional<std::pair<std::string, bool>> FakeKernel::next_event() {
  std::uint64_t count = 0;
  if (read(monitor_, &count, sizeof count) < 0) return {};
  const std::lock_guard lock(mutex_);
  if (events_.empty()) return {};
  auto event = events_.front();
  events_.pop_front();
  return event;
}

void FakeKernel::forget_events() {
  while (next_event()) {
  }
}

void FakeKernel::tell(std::initializer_list<std::pair<std::string, bool>> events) {
  {
    const std::lock_guard lock(mutex_);
    events_.insert(events_.end(), events);
  }
  const std::uint64_t count = events.size();
  if (write(monitor_, &count, sizeof count) < 0) std::perror("fake udev");
}

int FakeKernel::set_format(v4l2_pix_format& pix, bool set, bool get) {
  if (get) {
    pix.pixelformat = format_;
    pix.width = static_cast<unsigned>(width_);
    pix.height = static_cast<unsigned>(height_);
  } else {
    bool known = false;
    for (const std::uint32_t format : settings_.formats) known |= format == pix.pixelformat;
    if (!known) pix.pixelformat = settings_.formats.front();
    const bool whole = static_cast<int>(pix.width) >= settings_.width;
    pix.width = static_cast<unsigned>(settings_.width / (whole ? 1 : 2));
    pix.height = static_cast<unsigned>(settings_.height / (whole ? 1 : 2));
  }
  const auto before = std::pair(format_, std::pair(width_, height_));
  format_ = pix.pixelformat;
  width_ = static_cast<int>(pix.width);
  height_ = static_cast<int>(pix.height);
  pix.field = V4L2_FIELD_NONE;
  pix.bytesperline = static_cast<unsigned>(row_bytes());
  pix.sizeimage = static_cast<unsigned>(image_bytes());
  pix.colorspace = V4L2_COLORSPACE_RAW;
  if (!set) {
    format_ = before.first;
    width_ = before.second.first;
    height_ = before.second.second;
  }
  return 0;
}

int FakeKernel::request_buffers(v4l2_requestbuffers& request) {
  request.capabilities =
      V4L2_BUF_CAP_SUPPORTS_MMAP | V4L2_BUF_CAP_SUPPORTS_DMABUF | V4L2_BUF_CAP_SUPPORTS_ORPHANED_BUFS;
  if (request.memory != V4L2_MEMORY_MMAP) return 0;
  for (const int fd : buffers_) close(fd);
  buffers_.clear();
  for (unsigned i = 0; i < request.count; ++i) {
    buffers_.push_back(memfd_create("fake camera", MFD_CLOEXEC));
    if (ftruncate(buffers_.back(), image_bytes()) != 0) return fail(ENOMEM);
  }
  return 0;
}

int FakeKernel::dequeue(v4l2_buffer& buffer) {
  std::uint64_t count = 0;
  if (read(video_, &count, sizeof count) < 0) return fail(EAGAIN);
  const std::lock_guard lock(mutex_);
  if (done_.empty()) return fail(EAGAIN);
  buffer = done_.front();
  done_.pop_front();
  return 0;
}

int FakeKernel::video_ioctl(unsigned long request, void* argument) {
  if (gone_) return fail(ENODEV);
  switch (static_cast<std::uint32_t>(request)) {
    case VIDIOC_QUERYCAP: {
      auto& caps = *static_cast<v4l2_capability*>(argument);
      caps = {};
      std::strcpy(reinterpret_cast<char*>(caps.driver), "uvcvideo");
      std::strcpy(reinterpret_cast<char*>(caps.card), "Fake depth camera");
      std::strcpy(reinterpret_cast<char*>(caps.bus_info), "usb-fake-1");
      caps.version = 0x60100;
      caps.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_EXT_PIX_FORMAT;
      caps.capabilities = caps.device_caps | V4L2_CAP_DEVICE_CAPS;
      return 0;
    }
    case VIDIOC_ENUM_FMT: {
      auto& format = *static_cast<v4l2_fmtdesc*>(argument);
      if (format.index >= settings_.formats.size()) return fail(EINVAL);
      format.flags = 0;
      format.pixelformat = settings_.formats[format.index];
      return 0;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      auto& size = *static_cast<v4l2_frmsizeenum*>(argument);
      if (size.index > 1) return fail(EINVAL);
      size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
      size.discrete.width = static_cast<unsigned>(settings_.width) >> size.index;
      size.discrete.height = static_cast<unsigned>(settings_.height) >> size.index;
      return 0;
    }
    case VIDIOC_G_FMT:
      return set_format(static_cast<v4l2_format*>(argument)->fmt.pix, false, true);
    case VIDIOC_TRY_FMT:
      return set_format(static_cast<v4l2_format*>(argument)->fmt.pix, false, false);
    case VIDIOC_S_FMT:
      return set_format(static_cast<v4l2_format*>(argument)->fmt.pix, true, false);
    case VIDIOC_REQBUFS:
      return request_buffers(*static_cast<v4l2_requestbuffers*>(argument));
    case VIDIOC_QUERYBUF: {
      auto& buffer = *static_cast<v4l2_buffer*>(argument);
      if (buffer.index >= buffers_.size()) return fail(EINVAL);
      buffer.length = static_cast<unsigned>(image_bytes());
      buffer.m.offset = buffer.index * 0x100000;
      buffer.flags = 0;
      return 0;
    }
    case VIDIOC_EXPBUF: {
      auto& buffer = *static_cast<v4l2_exportbuffer*>(argument);
      if (buffer.index >= buffers_.size()) return fail(EINVAL);
      buffer.fd = fcntl(buffers_[buffer.index], F_DUPFD_CLOEXEC, 0);
      return 0;
    }
    case VIDIOC_QBUF: {
      const std::lock_guard lock(mutex_);
      queued_.push_back(*static_cast<v4l2_buffer*>(argument));
      return 0;
    }
    case VIDIOC_DQBUF:
      return dequeue(*static_cast<v4l2_buffer*>(argument));
    case VIDIOC_STREAMON:
      streaming_ = true;
      thread_ = std::thread([this] { stream(); });
      return 0;
    case VIDIOC_STREAMOFF:
      stop_stream();
      return 0;
    default:
      return fail(ENOTTY);
  }
}

int FakeKernel::media_ioctl(unsigned long request, void* argument) {
  if (static_cast<std::uint32_t>(request) == MEDIA_IOC_DEVICE_INFO) {
    auto& info = *static_cast<media_device_info*>(argument);
    info = {};
    std::strcpy(info.driver, "uvcvideo");
    std::strcpy(info.model, "Fake depth camera");
    info.media_version = info.driver_version = 0x60100;
    return 0;
  }
  if (static_cast<std::uint32_t>(request) != MEDIA_IOC_G_TOPOLOGY) return fail(ENOTTY);
  auto& topology = *static_cast<media_v2_topology*>(argument);
  topology.topology_version = 1;
  topology.num_entities = topology.num_interfaces = topology.num_links = 1;
  topology.num_pads = 0;
  if (topology.ptr_entities != 0) {
    auto& entity = *reinterpret_cast<media_v2_entity*>(topology.ptr_entities);
    entity = {};
    entity.id = 1;
    std::strcpy(entity.name, "Fake depth camera");
    entity.function = MEDIA_ENT_F_IO_V4L;
    entity.flags = MEDIA_ENT_FL_DEFAULT;
  }
  if (topology.ptr_interfaces != 0) {
    auto& node = *reinterpret_cast<media_v2_interface*>(topology.ptr_interfaces);
    node = {};
    node.id = 2;
    node.intf_type = MEDIA_INTF_T_V4L_VIDEO;
    node.devnode.major = 81;
  }
  if (topology.ptr_links != 0) {
    auto& link = *reinterpret_cast<media_v2_link*>(topology.ptr_links);
    link = {};
    link.id = 3;
    link.source_id = 2;
    link.sink_id = 1;
    link.flags = MEDIA_LNK_FL_INTERFACE_LINK | MEDIA_LNK_FL_ENABLED;
  }
  return 0;
}

}  // namespace tubetrack::test
