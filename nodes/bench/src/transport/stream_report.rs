//! The results of a stream of samples, as rows of a table.

use super::memory::BYTES_PER_MB;
use super::received_samples::ReceivedSamples;
use puffer::table::ResultTable;
use serde_json::{Value, json};

/// A finished stream.
pub(super) struct StreamReport<'a> {
    /// Bytes of a sample.
    pub size: usize,
    /// Samples that were to be sent.
    pub count: u64,
    /// Receive buffer that was asked for, bytes.
    pub receive_buffer: usize,
    /// Receive buffers that were read back, bytes.
    pub buffers: &'a [u64],
    /// The samples of the readers that read to the end.
    pub live: &'a [ReceivedSamples],
    /// The samples of the reader that was stopped, if there was one.
    pub stopped: Option<&'a ReceivedSamples>,
    /// The last event of the publisher.
    pub published: &'a Value,
}

impl StreamReport<'_> {
    /// Adds all rows to `table`.
    pub(super) fn add_to(&self, table: &mut ResultTable) {
        self.add_setup(table);
        self.add_delivery(table);
        self.add_publisher(table);
        let rejected: u64 = self.all_readers().map(|r| r.rejected).sum();
        table.add("tiles rejected by checksum", rejected.to_string(), "rejected", rejected);
        if let Some(stopped) = self.stopped {
            let (had, missed) = (stopped.indices.len(), self.published_count("missed"));
            table.add(
                "stopped reader",
                format!("had {had} samples when it stopped; {missed} given up for it"),
                "stopped_reader",
                json!({ "had": had, "missed": missed }),
            );
        }
    }

    fn add_setup(&self, table: &mut ResultTable) {
        table.add(
            "receive buffer asked for",
            format!("{} bytes", self.receive_buffer),
            "receive_buffer_asked",
            self.receive_buffer,
        );
        let read_back: Vec<String> = self.buffers.iter().map(u64::to_string).collect();
        table.add(
            "read back (twice what is granted)",
            format!("{} bytes", read_back.join(", ")),
            "receive_buffer",
            json!(self.buffers),
        );
        table.add("sample", format!("{} bytes", self.size), "size", self.size);
    }

    fn add_delivery(&self, table: &mut ResultTable) {
        let delivered = self.live.iter().map(|r| r.indices.len() as u64).min().unwrap_or(0);
        let corrupt: u64 = self.all_readers().map(|r| r.corrupt).sum();
        let started = self.published_number("started");
        let last = self.live.iter().filter_map(|r| r.times.last()).fold(f64::NAN, |a, b| b.max(a));
        let rate = delivered as f64 * self.size as f64 / BYTES_PER_MB / (last - started);
        let gap = self.live.iter().map(|r| r.longest_gap(started)).fold(0.0, f64::max);
        table.add(
            "delivered to every live reader",
            format!("{delivered} of {}", self.count),
            "delivered",
            delivered,
        );
        table.add_value("count", self.count);
        table.add_value("readers", self.live.len());
        table.add("corrupt", corrupt.to_string(), "corrupt", corrupt);
        table.add("speed for each reader", format!("{rate:.1} MB/s"), "mb_per_s", rate);
        table.add("longest time between samples", format!("{gap:.2} s"), "longest_gap_s", gap);
    }

    fn add_publisher(&self, table: &mut ResultTable) {
        let peak = self.published_number("peak") / BYTES_PER_MB;
        let extra = peak - self.published_number("before") / BYTES_PER_MB;
        table.add(
            "publisher's peak memory",
            format!("{extra:.1} MB more than before ({peak:.1} MB in all)"),
            "peak_memory_mb",
            extra,
        );
        table.add_value("peak_memory_absolute_mb", peak);
        table.add(
            "longest publish()",
            format!("{:.2} s", self.published_number("longest_publish")),
            "longest_publish_s",
            self.published["longest_publish"].clone(),
        );
        let (tiles, repeated) = (self.published_count("tiles"), self.published_count("repeated"));
        table.add("tiles sent, sent again", format!("{tiles}, {repeated}"), "tiles", tiles);
        table.add_value("repeated", repeated);
    }

    fn all_readers(&self) -> impl Iterator<Item = &ReceivedSamples> {
        self.live.iter().chain(self.stopped)
    }

    /// A number of the publisher's event; NaN, which prints as such, if it is missing.
    fn published_number(&self, key: &str) -> f64 {
        self.published[key].as_f64().unwrap_or(f64::NAN)
    }

    /// A count of the publisher's event; 0 if it is missing.
    fn published_count(&self, key: &str) -> u64 {
        self.published[key].as_u64().unwrap_or(0)
    }
}
