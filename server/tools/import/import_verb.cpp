#include <filesystem>

#include <nlohmann/json.hpp>

#include "capture/recording/recording_layout.hpp"
#include "capture/recording/recording_writer.hpp"
#include "daemon/system.hpp"
#include "tools/import/import.hpp"
#include "tools/replay/replay_verbs.hpp"
#include "tools/verb_options.hpp"

namespace fiducap {
namespace {

namespace fs = std::filesystem;

/// Result of an import.
struct Imported {
  std::vector<std::uint64_t> images;  ///< Per camera.
  std::uint64_t imu{0};
  std::uint64_t twice{0};  ///< Samples with the stamp of the one before.
  std::vector<RecordingFinding> findings;
  bool usable{true};
};

ImportOptions options_of(ImportArguments& arguments) {
  static const SystemClock clock;  // nothing is paced
  ImportOptions options;
  options.clock = &clock;
  options.log_stamps = arguments.stamps == "log";
  options.imu_offset = from_seconds(arguments.imu_offset_s);
  options.imu_columns = arguments.imu_columns;
  options.imu_units = arguments.imu_units;
  if (arguments.imu.size() == 1 && is_file(arguments.imu.front())) {
    options.imu_csv = arguments.imu.front();
    arguments.imu.clear();
  }
  return options;
}

std::string stream_line(const FoundStream& stream) {
  std::string line = "  " + stream.text() + ": ";
  line += stream.count > 0 ? std::to_string(stream.count) : std::string("not counted");
  if (stream.rate_hz() > 0)
    line += ", " + fixed(stream.rate_hz(), 1) + " Hz, " +
            fixed(static_cast<double>(stream.last_ns - stream.first_ns) * 1e-9, 1) + " s";
  if (stream.kind == FoundKind::kImages)
    line += stream.lens_known ? ", with its lens" : ", without a lens (" + stream.lens_fault + ")";
  if (stream.unreadable > 0)
    line += "; " + std::to_string(stream.unreadable) + " unreadable: " + stream.first_fault;
  return line;
}

void print_source(const ImportSource& source, const std::string& path, const Terminal& terminal) {
  terminal.out << path << "\n";
  for (const FoundStream& stream : source.streams()) terminal.out << stream_line(stream) << "\n";
  for (const std::string& other : source.others()) terminal.out << "  " << other << ": not used\n";
  for (const std::string& remark : source.remarks()) terminal.out << "  note: " << remark << "\n";
}

/// Counts samples and rejects repeated stamps, which would overwrite pictures.
class ImportCounter final {
 public:
  explicit ImportCounter(std::size_t cameras) : last_(cameras + 1, Instant::min()) {
    done_.images.resize(cameras);
  }
  bool take(const SensorSample& sample) {
    const auto* frame = std::get_if<CameraFrame>(&sample);
    const std::size_t stream = frame == nullptr ? 0 : 1 + static_cast<std::size_t>(frame->camera);
    if (time_of(sample) == last_[stream]) {
      ++done_.twice;
      return false;
    }
    last_[stream] = time_of(sample);
    ++(frame == nullptr ? done_.imu : done_.images[stream - 1]);
    return true;
  }
  [[nodiscard]] const Imported& done() const { return done_; }

 private:
  std::vector<Instant> last_;
  Imported done_;
};

std::string progress_text(const Imported& done, const ImportSource& source,
                          const ImportChoice& choice) {
  std::uint64_t images = 0;
  std::uint64_t expected = 0;
  for (const std::uint64_t n : done.images) images += n;
  for (const std::size_t i : choice.images) expected += source.streams()[i].count;
  std::string text = "writing: " + std::to_string(images);
  if (expected > 0) text += " of " + std::to_string(expected);
  return text + " images, " + std::to_string(done.imu) + " IMU readings";
}

Expected<Imported> write_recording(ImportSource& source, const ImportPlan& plan,
                                   const Terminal& terminal) {
  auto samples = source.open(plan.choice, plan.info.cameras);
  if (!samples) return tl::unexpected(samples.error());
  auto writer = RecordingWriter::create(plan.info);
  if (!writer) return tl::unexpected(writer.error());
  ProgressLine line(terminal);
  ImportCounter counter(plan.info.cameras.size());
  for (;;) {
    if (interrupted()) return fail(ErrorCode::kUnavailable, "interrupted");
    const auto sample = (*samples)->next({});
    if (!sample) return tl::unexpected(sample.error());
    if (!*sample) break;
    if (to_ns(time_of(**sample)) < 0)
      return fail(ErrorCode::kInvalid,
                  "a stamp is before 1970: --imu-offset, or the clock of a sensor, is wrong");
    if (!counter.take(**sample)) continue;
    if (const auto written = writer->write(**sample); !written)
      return tl::unexpected(written.error());
    line.show(progress_text(counter.done(), source, plan.choice));
  }
  const auto truth = source.truth();
  if (!truth) return tl::unexpected(truth.error());
  for (const TruthSample& one : *truth)
    if (const auto written = writer->write_truth(one); !written)
      return tl::unexpected(written.error());
  if (const auto finished = writer->finish(); !finished) return tl::unexpected(finished.error());
  return counter.done();
}

nlohmann::ordered_json stream_json(const FoundStream& stream) {
  nlohmann::ordered_json json{
      {"name", stream.name},           {"kind", stream.kind == FoundKind::kImu ? "imu" : "images"},
      {"type", stream.type},           {"count", stream.count},
      {"first_ns", stream.first_ns},   {"last_ns", stream.last_ns},
      {"rate_hz", stream.rate_hz()},   {"zero_stamps", stream.zero_stamps},
      {"backwards", stream.backwards}, {"unreadable", stream.unreadable}};
  if (stream.kind == FoundKind::kImu) return json;
  json["width"] = stream.mount.model.width;
  json["height"] = stream.mount.model.height;
  json["lens_known"] = stream.lens_known;
  json["place_known"] = stream.place == CameraPlace::kOnBody;
  return json;
}

nlohmann::ordered_json source_json(const ImportSource& source, const std::string& path) {
  nlohmann::ordered_json json{{"source", path}, {"streams", nlohmann::ordered_json::array()}};
  for (const FoundStream& stream : source.streams()) json["streams"].push_back(stream_json(stream));
  json["others"] = source.others();
  json["notes"] = source.remarks();
  return json;
}

void print_imported(const ImportSource& source, const ImportPlan& plan, const Imported& done,
                    const Terminal& terminal) {
  terminal.out << plan.info.folder << ":";
  if (done.images.empty()) terminal.out << " no images,";
  for (std::size_t k = 0; k < done.images.size(); ++k)
    terminal.out << " " << done.images[k] << " images of "
                 << source.streams()[plan.choice.images[k]].name << ",";
  if (plan.choice.imu)
    terminal.out << " " << done.imu << " IMU readings of "
                 << source.streams()[*plan.choice.imu].name << "\n";
  else
    terminal.out << " no IMU\n";
  for (const std::string& remark : plan.remarks) terminal.out << "  note: " << remark << "\n";
  if (done.twice > 0)
    terminal.out << "  note: " << done.twice << " samples have the stamp of the one before: left "
                 << "out\n";
  print_findings(terminal, done.findings);
  for (const std::string& item : plan.to_do) terminal.out << "  missing: " << item << "\n";
  if (done.images.empty())
    terminal.out << "next: fiducap calibrate imu " << plan.info.folder << "\n";
  else if (done.usable)
    terminal.out << "next: fiducap replay " << plan.info.folder << " --out results\n";
}

void print_imported_json(nlohmann::ordered_json json, const ImportPlan& plan, const Imported& done,
                         const Terminal& terminal) {
  json["folder"] = plan.info.folder;
  json["images_written"] = done.images;
  json["imu_written"] = done.imu;
  json["same_stamp"] = done.twice;
  for (const std::string& remark : plan.remarks) json["notes"].push_back(remark);
  json["usable"] = done.usable;
  json["findings"] = findings_json(done.findings);
  json["missing"] = plan.to_do;
  print_json(terminal, json);
}

/// Removes what was written when it fails, so that the folder is free for the next try.
Expected<Imported> make_recording(ImportSource& source, const ImportPlan& plan,
                                  const Terminal& terminal) {
  std::error_code failure;
  const bool is_ours =
      !fs::exists(plan.info.folder, failure) || fs::is_empty(plan.info.folder, failure);
  catch_interrupt();
  auto done = write_recording(source, plan, terminal);
  if (!done && is_ours && !failure) {
    const bool was_written = fs::remove_all(plan.info.folder, failure) > 1;  // the folder itself
    if (was_written && !failure) done.error().what += "; what was written is removed";
  }
  if (!done) return done;
  // Why no image could be decoded is in the log.
  for (std::size_t k = 0; k < done->images.size(); ++k)
    if (done->images[k] == 0)
      return fail(
          ErrorCode::kInvalid,
          "no image of " + source.streams()[plan.choice.images[k]].text() + " could be decoded");
  if (done->images.empty()) return done;  // an IMU alone is no recording to replay
  auto checked = read_recording_info(plan.info.folder).and_then(check_recording);
  if (!checked) return tl::unexpected(checked.error());
  done->usable = checked->is_usable();
  done->findings = std::move(checked->findings);
  return done;
}

}  // namespace

int run_import(const ImportArguments& given, const Terminal& terminal) {
  ImportArguments arguments = given;
  const auto refuse = [&](const Error& why) {
    return report(terminal, in_context(why, comma_list(given.sources)));
  };
  const auto source = [&] {
    ProgressLine line(terminal);
    return open_import(arguments.sources, options_of(arguments), [&](double share) {
      line.show("looking through " + comma_list(given.sources) + ": " + fixed(100 * share, 0) +
                " %");
    });
  }();
  if (!source) return refuse(source.error());
  if (!arguments.json) print_source(**source, comma_list(given.sources), terminal);
  if (arguments.out.empty()) {
    const bool names_streams = !given.images.empty() || !given.imu.empty();  // they must exist
    if (const auto chosen = choose_streams(**source, arguments); !chosen && names_streams)
      return refuse(chosen.error());
    if (arguments.json) print_json(terminal, source_json(**source, comma_list(given.sources)));
    return kExitOk;
  }
  const auto plan = plan_import(**source, arguments);
  if (!plan) return refuse(plan.error());
  const auto done = make_recording(**source, *plan, terminal);
  if (!done) return refuse(done.error());
  if (arguments.json)
    print_imported_json(source_json(**source, comma_list(given.sources)), *plan, *done, terminal);
  else
    print_imported(**source, *plan, *done, terminal);
  return done->usable ? kExitOk : kExitFailed;
}

void add_import(CLI::App& app, ChosenVerb& chosen) {
  auto* verb = app.add_subcommand(
      "import",
      "Make a recording of what another program recorded: bags of ROS 1 and 2, MCAP, a video with "
      "an IMU's table, folders of EuRoC and Kalibr, phones (Sensor Logger), an IMU alone");
  auto& a = arguments_of<ImportArguments>(*verb, chosen, run_import);
  verb->add_option("SOURCE", a.sources,
                   "A .bag, .db3, .mcap, .zip, video or IMU's CSV file, or a folder of bags, "
                   "rosbag2, EuRoC, Kalibr or Sensor Logger; several bags are one recording")
      ->required();
  verb->add_option("--out", a.out, "New folder for the recording; without it only list");
  verb->add_option("--image", a.images,
                   "Images to take, or 'none'; several times for several cameras of one body")
      ->allow_extra_args(false);
  verb->add_option("--imu", a.imu,
                   "IMU to take, or 'none'; two where gyroscope and accelerometer have a topic "
                   "each; beside a video: its table, a CSV file")
      ->allow_extra_args(false);
  verb->add_option("--calibration", a.calibrations,
                   "Lens, place or noise: a file per camera in their order (OpenCV, ROS, EuRoC), "
                   "Kalibr's camchain, Kalibr's imu.yaml")
      ->allow_extra_args(false);
  add_positive(*verb, "--tag-size", a.tag_size_m, "Edge between black and white border, metres");
  verb->add_option("--tag-family", a.tag_family, "Tag family, e.g. tag36h11");
  verb->add_option("--stamps", a.stamps,
                   "Stamps to use: 'header', of the sensor, or 'log', of the recorder")
      ->check(CLI::IsMember({"header", "log"}))
      ->capture_default_str();
  verb->add_option("--imu-offset", a.imu_offset_s, "Seconds to add to the stamps of the IMU");
  verb->add_option("--imu-columns", a.imu_columns,
                   "Of a table: the names of time, gyro x y z, accelerometer x y z");
  verb->add_option("--imu-units", a.imu_units, "Of a table: e.g. us,deg/s,g");
  verb->add_flag("--json", a.json, "What was found and written, for scripts");
  verb->footer(
      "Example:\n"
      "  fiducap import flight.bag\n"
      "  fiducap import flight_0.bag flight_1.bag --out recordings/flight --image /cam0/image_raw "
      "--imu /imu0 "
      "--tag-size 0.16\n"
      "  fiducap import walk.mp4 --imu walk.csv --imu-units ms,deg/s,g --out recordings/walk");
}

}  // namespace fiducap
