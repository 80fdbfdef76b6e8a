//! A node of ROS 2 by `hiroz`: operator, camera and driver for `tautscope ros2 --driver`, and a client of its parameters.
//!
//! Requests come on standard input, a word a line; results go to standard output as JSON, one object a line.

mod parameters;
mod record;
mod stream;

use std::io::Write;
use std::sync::Arc;

use hiroz::prelude::*;

fn say(text: String) {
    println!("{text}");
    std::io::stdout().flush().expect("standard output");
}

#[tokio::main]
async fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, endpoint, what, rest @ ..] = arguments.as_slice() else {
        panic!("usage: peer ENDPOINT parameters | peer ENDPOINT stream FRAMES");
    };
    let context = ZContextBuilder::default()
        .with_mode("peer")
        .with_connect_endpoints([endpoint.as_str()])
        .disable_multicast_scouting()
        .build()?;
    let node = Arc::new(context.create_node("peer").build()?);
    if what == "parameters" {
        return parameters::parameters(node).await;
    }
    let (width, height) = stream::SIZE;
    let frames = std::fs::read(&rest[0])?
        .chunks_exact(3 * width as usize * height as usize)
        .map(<[u8]>::to_vec)
        .collect();
    tokio::task::spawn_blocking(move || stream::stream(node, frames)).await?
}
