#include "support/log_files.hpp"

#include <bzlib.h>
#include <lz4frame.h>
#include <sqlite3.h>
#include <zlib.h>
#include <zstd.h>

#include <map>
#include <stdexcept>

namespace fiducap::test {
namespace {

template <typename U>
std::string le(U v) {
  std::string out;
  for (std::size_t i = 0; i < sizeof(U); ++i)
    out += static_cast<char>((static_cast<std::uint64_t>(v) >> (8 * i)) & 0xff);
  return out;
}
std::string sized(const std::string& text) { return le<std::uint32_t>(text.size()) + text; }
std::uint32_t crc_of_text(const std::string& text) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(text.data()), text.size()));
}
void require(bool holds, const char* what) {
  if (!holds) throw std::runtime_error(what);
}

std::string packed(const std::string& text, const std::string& compression) {
  std::string out(text.size() * 2 + 4096, '\0');
  if (compression == "bz2") {
    auto size = static_cast<unsigned>(out.size());
    require(BZ2_bzBuffToBuffCompress(out.data(), &size, const_cast<char*>(text.data()),
                                     static_cast<unsigned>(text.size()), 9, 0, 30) == BZ_OK,
            "bz2");
    out.resize(size);
  } else if (compression == "lz4") {
    const std::size_t size =
        LZ4F_compressFrame(out.data(), out.size(), text.data(), text.size(), nullptr);
    require(LZ4F_isError(size) == 0, "lz4");
    out.resize(size);
  } else if (compression == "zstd") {
    const std::size_t size = ZSTD_compress(out.data(), out.size(), text.data(), text.size(), 3);
    require(ZSTD_isError(size) == 0, "zstd");
    out.resize(size);
  } else {
    out = text;
  }
  return out;
}

std::string field(const std::string& name, const std::string& value) {
  return sized(name + "=" + value);
}
std::string bag_record(const std::string& header, const std::string& data) {
  return sized(header) + sized(data);
}
std::string bag_time(std::int64_t ns) {
  return le<std::uint32_t>(ns / 1'000'000'000) + le<std::uint32_t>(ns % 1'000'000'000);
}
std::string op(char code) { return field("op", std::string(1, code)); }

std::string connection_record(std::uint32_t id, const StoredMessage& message) {
  return bag_record(op(7) + field("conn", le(id)) + field("topic", message.topic),
                    field("topic", message.topic) + field("type", message.type) +
                        field("md5sum", "*") + field("message_definition", ""));
}

std::string mcap_record(int code, const std::string& content) {
  return static_cast<char>(code) + le<std::uint64_t>(content.size()) + content;
}

std::string ros2_type(const std::string& type) {
  const std::size_t slash = type.find('/');
  return type.substr(0, slash) + "/msg" + type.substr(slash);
}

}  // namespace

std::string bag_file(const std::vector<StoredMessage>& messages, const LogFileOptions& options) {
  std::map<std::string, std::uint32_t> ids;
  std::string chunks, chunk, index;
  std::size_t in_chunk = 0;
  const auto close_chunk = [&] {
    if (chunk.empty()) return;
    const auto packed_chunk = [&] {
      return bag_record(op(5) + field("compression", options.compression) +
                            field("size", le<std::uint32_t>(chunk.size())),
                        packed(chunk, options.compression));
    };
    if (options.nested) chunk = packed_chunk();
    chunks += packed_chunk();
    chunks += bag_record(op(4) + field("ver", le<std::uint32_t>(1)), "");  // an index, not read
    chunk.clear();
    in_chunk = 0;
  };
  for (const StoredMessage& message : messages) {
    const auto [known, is_new] = ids.emplace(message.topic, ids.size());
    if (is_new) chunk += connection_record(known->second, message);
    if (is_new) index += connection_record(known->second, message);
    chunk += bag_record(
        op(2) + field("conn", le(known->second)) + field("time", bag_time(message.logged_ns)),
        message.bytes);
    if (++in_chunk == options.messages_per_chunk) close_chunk();
  }
  close_chunk();
  const std::string head = op(3) + field("conn_count", le<std::uint32_t>(ids.size())) +
                           field("chunk_count", le<std::uint32_t>(1)) +
                           field("index_pos", le<std::uint64_t>(options.closed ? 4096 : 0));
  return "#ROSBAG V2.0\n" + bag_record(head, std::string(4096 - 13 - 8 - head.size(), ' ')) +
         chunks + (options.closed ? index : std::string());
}

std::string mcap_file(const std::vector<StoredMessage>& messages, const LogFileOptions& options) {
  const std::string magic("\x89MCAP0\r\n", 8);
  std::map<std::string, std::uint16_t> ids;
  std::string all = magic;
  all += mcap_record(1, sized(options.ros2 ? "ros2" : "ros1") + sized("fiducap tests"));
  std::string chunk, known;
  std::size_t in_chunk = 0;
  bool first = true;
  const auto close_chunk = [&] {
    if (chunk.empty()) return;
    const std::uint32_t crc = crc_of_text(chunk) ^ (options.wrong_crc && first ? 1u : 0u);
    first = false;
    const std::string records = packed(chunk, options.compression);
    const std::string name = options.compression == "none" ? "" : options.compression;
    all += mcap_record(6, le<std::uint64_t>(0) + le<std::uint64_t>(0) +
                              le<std::uint64_t>(chunk.size()) + le(crc) + sized(name) +
                              le<std::uint64_t>(records.size()) + records);
    chunk.clear();
    in_chunk = 0;
  };
  for (const StoredMessage& message : messages) {
    const auto [id, is_new] =
        ids.emplace(message.topic, static_cast<std::uint16_t>(ids.size() + 1));
    if (is_new) {
      const std::string type = options.ros2 ? ros2_type(message.type) : message.type;
      const std::string about =
          mcap_record(3, le(id->second) + sized(type) +
                             sized(options.ros2 ? "ros2msg" : "ros1msg") + sized("")) +
          mcap_record(4, le(id->second) + le(id->second) + sized(message.topic) +
                             sized(options.ros2 ? "cdr" : "ros1") + le<std::uint32_t>(0));
      chunk += about;
      known += about;
    }
    chunk += mcap_record(5, le(id->second) + le<std::uint32_t>(0) +
                                le<std::uint64_t>(message.logged_ns) +
                                le<std::uint64_t>(message.logged_ns) + message.bytes);
    if (++in_chunk == options.messages_per_chunk) close_chunk();
  }
  close_chunk();
  if (!options.closed) return all;
  const std::uint32_t data_crc = crc_of_text(all);
  all += mcap_record(15, le(data_crc));
  const std::size_t summary = all.size();
  all += known;
  const std::string footer = le<std::uint64_t>(summary) + le<std::uint64_t>(0);
  const std::string head = "\x02" + le<std::uint64_t>(footer.size() + 4);
  const std::uint32_t summary_crc = crc_of_text(all.substr(summary) + head + footer);
  return all + head + footer + le(summary_crc) + magic;
}

void write_db3(const std::string& path, const std::vector<StoredMessage>& messages) {
  sqlite3* file = nullptr;
  require(sqlite3_open(path.c_str(), &file) == SQLITE_OK, "db3");
  const auto run = [&](const std::string& sql) {
    require(sqlite3_exec(file, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK, "db3 sql");
  };
  run("PRAGMA synchronous = OFF");
  run("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
      "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)");
  run("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER "
      "NOT NULL, data BLOB NOT NULL)");
  run("BEGIN");
  std::map<std::string, std::size_t> ids;
  for (const StoredMessage& message : messages) {
    const auto [id, is_new] = ids.emplace(message.topic, ids.size() + 1);
    const std::string number = std::to_string(id->second);
    if (is_new)
      run("INSERT INTO topics VALUES(" + number + ", '" + message.topic + "', '" +
          ros2_type(message.type) + "', 'cdr', '')");
    sqlite3_stmt* row = nullptr;
    const std::string sql = "INSERT INTO messages(topic_id, timestamp, data) VALUES(" + number +
                            ", " + std::to_string(message.logged_ns) + ", ?)";
    sqlite3_prepare_v2(file, sql.c_str(), -1, &row, nullptr);
    sqlite3_bind_blob64(row, 1, message.bytes.data(), message.bytes.size(), SQLITE_STATIC);
    require(sqlite3_step(row) == SQLITE_DONE, "db3 row");
    sqlite3_finalize(row);
  }
  run("COMMIT");
  sqlite3_close(file);
}

std::string zip_file(const std::vector<StoredFile>& files) {
  std::string all, directory;
  for (const StoredFile& file : files) {
    std::string content = file.content;
    if (file.deflated) {
      z_stream stream{};
      require(deflateInit2(&stream, 6, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) == Z_OK,
              "zip");
      content.assign(file.content.size() + 1024, '\0');
      stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(file.content.data()));
      stream.avail_in = static_cast<uInt>(file.content.size());
      stream.next_out = reinterpret_cast<Bytef*>(content.data());
      stream.avail_out = static_cast<uInt>(content.size());
      require(deflate(&stream, Z_FINISH) == Z_STREAM_END, "zip content");
      content.resize(stream.total_out);
      deflateEnd(&stream);
    }
    const std::string method = le<std::uint16_t>(0) + le<std::uint16_t>(file.deflated ? 8 : 0) +
                               le<std::uint32_t>(0) + le(crc_of_text(file.content));
    const std::string sizes =
        le<std::uint32_t>(content.size()) + le<std::uint32_t>(file.content.size());
    const std::string extra = file.zip64 ? le<std::uint16_t>(1) + le<std::uint16_t>(16) +
                                               le<std::uint64_t>(file.content.size()) +
                                               le<std::uint64_t>(content.size())
                                         : std::string();
    directory += "PK\x01\x02" + le<std::uint16_t>(20) + le<std::uint16_t>(20) + method +
                 (file.zip64 ? std::string(8, '\xff') : sizes) +
                 le<std::uint16_t>(file.name.size()) + le<std::uint16_t>(extra.size()) +
                 le<std::uint16_t>(0) + le<std::uint16_t>(0) + le<std::uint16_t>(0) +
                 le<std::uint32_t>(0) + le<std::uint32_t>(all.size()) + file.name + extra;
    const std::string about =
        method + sizes + le<std::uint16_t>(file.name.size()) + le<std::uint16_t>(0);
    all += "PK\x03\x04" + le<std::uint16_t>(20) + about + file.name + content;
  }
  return all + directory + "PK\x05\x06" + le<std::uint32_t>(0) + le<std::uint16_t>(files.size()) +
         le<std::uint16_t>(files.size()) + le<std::uint32_t>(directory.size()) +
         le<std::uint32_t>(all.size()) + le<std::uint16_t>(0);
}

}  // namespace fiducap::test
