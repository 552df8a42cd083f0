extern "C" {
#include <libavformat/avformat.h>
}

#include <algorithm>
#include <memory>

#include "capture/video/video_source.hpp"

namespace fiducap::video {
namespace {

struct Close {
  void operator()(AVFormatContext* file) const { avformat_close_input(&file); }
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};

std::unique_ptr<AVFormatContext, Close> open_container(const std::string& path) {
  AVFormatContext* opened = nullptr;
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);  // a playlist opens nothing else
  const int failure = avformat_open_input(&opened, path.c_str(), nullptr, &options);
  av_dict_free(&options);
  if (failure != 0) return nullptr;
  std::unique_ptr<AVFormatContext, Close> file(opened);
  return avformat_find_stream_info(opened, nullptr) < 0 ? nullptr : std::move(file);
}

/// OpenCV's choice: the first one.
const AVStream* video_stream_of(const AVFormatContext& file) {
  for (unsigned i = 0; i < file.nb_streams; ++i)
    if (file.streams[i]->codecpar->codec_type == AVMEDIA_TYPE_VIDEO) return file.streams[i];
  return nullptr;
}

}  // namespace

std::vector<Duration> container_stamps(const std::string& path) {
  std::vector<Duration> stamps;
  const auto file = open_container(path);
  const AVStream* video = file ? video_stream_of(*file) : nullptr;
  if (video == nullptr) return stamps;
  const std::unique_ptr<AVPacket, Close> packet(av_packet_alloc());
  const std::int64_t start = video->start_time == AV_NOPTS_VALUE ? 0 : video->start_time;
  while (packet && av_read_frame(file.get(), packet.get()) == 0) {
    if (packet->stream_index == video->index && packet->pts != AV_NOPTS_VALUE)
      stamps.push_back(
          from_seconds(static_cast<double>(packet->pts - start) * av_q2d(video->time_base)));
    av_packet_unref(packet.get());
  }
  std::ranges::sort(stamps);
  return stamps;
}

}  // namespace fiducap::video
