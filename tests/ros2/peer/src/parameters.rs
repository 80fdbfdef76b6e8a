//! A client of the node's parameters.

use std::sync::Arc;
use std::time::Duration;

use hiroz::prelude::*;

use crate::say;

/// Lists, reads and sets parameters, and prints the answers.
pub async fn parameters(node: Arc<ZNode>) -> Result<()> {
    let target = ParameterTarget::from_fqn("/tautscope").expect("name");
    let client = ParameterClient::new(node, target)?;
    tokio::time::sleep(Duration::from_secs(1)).await;
    let listed = client.list(&[] as &[&str], None).await?;
    let before = client
        .get(&["compensation", "control.period", "profile", "nothing"])
        .await?;
    let described = client.describe(&["compensation"]).await?;
    let set = |value: f64| Parameter::new("compensation", ParameterValue::Double(value));
    let results = client.set(&[set(0.5), set(2.0)]).await?;
    let atomic = client
        .set_atomically(&[
            set(0.25),
            Parameter::new("profile", ParameterValue::String("paper".into())),
        ])
        .await?;
    let after = client.get(&["compensation"]).await?;
    let outcomes: Vec<bool> = results.iter().map(|each| each.successful).collect();
    say(format!("list {:?}", listed.names));
    say(format!("get {before:?}"));
    say(format!(
        "read_only {} range {:?}",
        described[0].read_only, described[0].floating_point_range
    ));
    say(format!("set {outcomes:?} {:?}", results[1].reason));
    say(format!("atomic {} {:?}", atomic.successful, atomic.reason));
    say(format!("after {after:?}"));
    Ok(())
}
