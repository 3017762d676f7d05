// The functions of libc and libudev that libcamera calls: an executable's come before the libraries'. For all but the
// fake camera's paths and descriptors they pass on to the real ones.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/sysmacros.h>

#include <cstdarg>
#include <cstring>
#include <string>
#include <string_view>

#include "sensors/fake_kernel.hpp"

using tubetrack::test::FakeKernel;
using tubetrack::test::kFakeMedia;
using tubetrack::test::kFakeVideo;

namespace {

template <class Function>
Function next_one(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

bool is_ours(const char* path) {
  return std::string_view(path) == kFakeVideo || std::string_view(path) == kFakeMedia;
}

}  // namespace

// libudev's types are opaque: these are ours.
struct udev {};
struct udev_monitor {};
struct udev_enumerate {};
struct udev_device {
  bool is_video = false;
  std::string action;
};
struct udev_list_entry {
  const char* name;
  udev_list_entry* next;
};

namespace {
udev g_udev;
udev_monitor g_monitor;
udev_enumerate g_enumerate;
udev_list_entry g_video_entry{"fake/video0", nullptr};
udev_list_entry g_media_entry{"fake/media0", &g_video_entry};
}  // namespace

extern "C" {

udev* udev_new() {
  return &g_udev;
}
udev* udev_unref(udev*) {
  return nullptr;
}
udev_monitor* udev_monitor_new_from_netlink(udev*, const char*) {
  FakeKernel::get().forget_events();
  return &g_monitor;
}
udev_monitor* udev_monitor_unref(udev_monitor*) {
  return nullptr;
}
int udev_monitor_filter_add_match_subsystem_devtype(udev_monitor*, const char*, const char*) {
  return 0;
}
int udev_monitor_enable_receiving(udev_monitor*) {
  return 0;
}
int udev_monitor_get_fd(udev_monitor*) {
  return FakeKernel::get().monitor();
}
udev_device* udev_monitor_receive_device(udev_monitor*) {
  auto event = FakeKernel::get().next_event();
  return event ? new udev_device{event->second, event->first} : nullptr;
}
udev_enumerate* udev_enumerate_new(udev*) {
  return &g_enumerate;
}
udev_enumerate* udev_enumerate_unref(udev_enumerate*) {
  return nullptr;
}
int udev_enumerate_add_match_subsystem(udev_enumerate*, const char*) {
  return 0;
}
int udev_enumerate_add_match_is_initialized(udev_enumerate*) {
  return 0;
}
int udev_enumerate_scan_devices(udev_enumerate*) {
  return 0;
}
udev_list_entry* udev_enumerate_get_list_entry(udev_enumerate*) {
  return FakeKernel::get().gone() ? nullptr : &g_media_entry;
}
udev_list_entry* udev_list_entry_get_next(udev_list_entry* entry) {
  return entry->next;
}
const char* udev_list_entry_get_name(udev_list_entry* entry) {
  return entry->name;
}
udev_device* udev_device_new_from_syspath(udev*, const char* path) {
  return new udev_device{std::strstr(path, "video") != nullptr, ""};
}
udev_device* udev_device_new_from_devnum(udev*, char, dev_t) {
  return new udev_device{true, ""};
}
udev_device* udev_device_unref(udev_device* device) {
  delete device;
  return nullptr;
}
const char* udev_device_get_devnode(udev_device* device) {
  return device->is_video ? kFakeVideo : kFakeMedia;
}
const char* udev_device_get_subsystem(udev_device* device) {
  return device->is_video ? "video4linux" : "media";
}
dev_t udev_device_get_devnum(udev_device* device) {
  return device->is_video ? makedev(81, 0) : makedev(250, 0);
}
const char* udev_device_get_action(udev_device* device) {
  return device->action.c_str();
}

int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const unsigned mode = (flags & O_CREAT) != 0 ? va_arg(rest, unsigned) : 0;
  va_end(rest);
  if (is_ours(path)) return *FakeKernel::get().open_device(path);
  return next_one<int (*)(const char*, int, ...)>("open64")(path, flags, mode);
}

long syscall(long number, ...) noexcept {
  va_list rest;
  va_start(rest, number);
  long a[6];
  for (long& argument : a) argument = va_arg(rest, long);
  va_end(rest);
  const auto* path = reinterpret_cast<const char*>(a[1]);
  if (number == SYS_openat && is_ours(path)) return *FakeKernel::get().open_device(path);
  static const auto next = next_one<long (*)(long, ...)>("syscall");
  return next(number, a[0], a[1], a[2], a[3], a[4], a[5]);
}

int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list rest;
  va_start(rest, request);
  void* argument = va_arg(rest, void*);
  va_end(rest);
  FakeKernel& kernel = FakeKernel::get();
  if (kernel.is_video(fd)) return kernel.video_ioctl(request, argument);
  if (kernel.is_media(fd)) return kernel.media_ioctl(request, argument);
  return next_one<int (*)(int, unsigned long, ...)>("ioctl")(fd, request, argument);
}

int stat64(const char* path, struct stat64* status) noexcept {
  if (std::string_view(path) != kFakeVideo)
    return next_one<int (*)(const char*, struct stat64*)>("stat64")(path, status);
  std::memset(status, 0, sizeof *status);
  status->st_mode = S_IFCHR | 0600;
  status->st_rdev = makedev(81, 0);
  return 0;
}

char* realpath(const char* path, char* resolved) noexcept {
  if (std::string_view(path) != "/sys/dev/char/81:0/device") {
    static const auto next =
        reinterpret_cast<char* (*)(const char*, char*)>(dlvsym(RTLD_NEXT, "realpath", "GLIBC_2.3"));
    return next(path, resolved);
  }
  const std::string place = FakeKernel::get().folder() + "/1-1/1-1:1.0";
  return resolved != nullptr ? std::strcpy(resolved, place.c_str()) : strdup(place.c_str());
}

int access(const char* path, int mode) noexcept {
  if (is_ours(path)) return 0;
  return next_one<int (*)(const char*, int)>("access")(path, mode);
}

}  // extern "C"
