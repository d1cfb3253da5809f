#include "core/telemetry/process_metrics.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>
#include <string>

#include "core/telemetry/metrics.h"

namespace glasswing {
namespace {

double resident_bytes() {
  std::ifstream file("/proc/self/statm");
  double all_pages = 0.0, resident_pages = 0.0;
  file >> all_pages >> resident_pages;
  return resident_pages * static_cast<double>(::sysconf(_SC_PAGESIZE));
}

// Excludes freed memory that the allocator keeps, which grows for an hour as blocks of all sizes come and go.
double heap_used_bytes() {
  const struct mallinfo2 heap = ::mallinfo2();
  return static_cast<double>(heap.uordblks + heap.hblkhd);
}

double seconds(const timeval& time) {
  return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
}

double cpu_seconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double max_descriptors() {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  return static_cast<double>(limit.rlim_cur);
}

double open_descriptors() {
  std::error_code failed;
  const std::filesystem::directory_iterator listed("/proc/self/fd", failed);
  if (failed == std::errc::too_many_files_open) return max_descriptors();  // none is left for the listing
  if (failed) return std::numeric_limits<double>::quiet_NaN();
  const auto count = std::distance(begin(listed), std::filesystem::directory_iterator());
  return static_cast<double>(count - 1);  // without the listing's own
}

// Unix time, s.
double started() {
  std::ifstream file("/proc/self/stat");
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  std::istringstream fields(text.substr(text.rfind(')') + 1));  // the program's name may hold spaces
  std::string field;
  for (int i = 3; i <= 22 && fields; ++i) fields >> field;  // proc(5) counts from 1: 22 is starttime
  const double after_boot = std::strtod(field.c_str(), nullptr) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  std::ifstream kernel("/proc/stat");
  double boot = 0.0;
  for (std::string line; std::getline(kernel, line);)
    if (line.rfind("btime ", 0) == 0) boot = std::strtod(line.c_str() + 6, nullptr);
  return boot + after_boot;
}

}  // namespace

std::vector<prometheus::MetricFamily> process_metrics() {
  static const double since = started();
  prometheus::MetricFamily cpu =
      gauges("process_cpu_seconds_total", "CPU time of the process, s.", {{{}, cpu_seconds()}});
  cpu.type = prometheus::MetricType::Counter;
  cpu.metric.front().counter.value = cpu.metric.front().gauge.value;
  return {
      cpu,
      gauges("process_resident_memory_bytes", "Memory that the process has in RAM.",
             {{{}, resident_bytes()}}),
      gauges("glasswing_heap_used_bytes", "Memory that the program asked for and has not given back.",
             {{{}, heap_used_bytes()}}),
      gauges("process_open_fds", "Open file descriptors.", {{{}, open_descriptors()}}),
      gauges("process_max_fds", "Most file descriptors that may be open.", {{{}, max_descriptors()}}),
      gauges("process_start_time_seconds", "When the process started, Unix time.", {{{}, since}}),
  };
}

std::vector<prometheus::MetricFamily> disk_metrics(const std::filesystem::path& directory) {
  std::error_code failed;
  const std::filesystem::space_info space = std::filesystem::space(directory, failed);
  if (failed) return {};
  const prometheus::Labels labels{{"directory", directory.string()}};
  return {
      gauges("glasswing_disk_free_bytes", "Free where the data lie.",
             {{labels, static_cast<double>(space.available)}}),
      gauges("glasswing_disk_size_bytes", "All there is where the data lie.",
             {{labels, static_cast<double>(space.capacity)}}),
  };
}

}  // namespace glasswing
